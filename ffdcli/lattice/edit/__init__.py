"""Edits of a lattice file, applied to control points, weights and knots."""
