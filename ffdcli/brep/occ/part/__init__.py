"""CAD parts read from files, and written again with new geometry on the same topology."""
