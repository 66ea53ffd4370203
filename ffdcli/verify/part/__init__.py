"""Verification of deformed parts: the file's faces, edges and vertices against the deformed part.

Both shapes are evaluated by OpenCascade and the deformation directly, so nothing is shared with
what fits curves and surfaces.
"""
