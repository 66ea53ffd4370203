"""Earlier methods of exact deformation, for comparison: Feng 1998, 2000 and 2002."""
