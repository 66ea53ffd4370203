"""Mesh files read and written, one module per format."""
