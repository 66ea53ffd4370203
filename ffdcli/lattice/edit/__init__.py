"""What the edits of a lattice file do to control points, weights and knots."""
