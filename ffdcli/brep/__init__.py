"""Boundary representations: assembled from surface patches, evaluated, written and read."""
