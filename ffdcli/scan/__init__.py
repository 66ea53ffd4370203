"""Scans of surfaces: meshes and point clouds, and where they lie on a model."""
