"""Triangles of a deformed mesh: plain, subdivided, or of its exact surfaces; and how far off."""
