"""Evaluation of boundary representations: points, distances, areas and volumes."""
