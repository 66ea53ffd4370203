"""Triangles of a deformed mesh, from its own triangles or the exact surfaces; their deviation."""
