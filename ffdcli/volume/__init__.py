"""Maps of lattice boxes: bases and control nets behind one protocol."""
