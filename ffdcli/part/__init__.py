"""Parts that are CAD already: their topology and geometry as arrays, and their deformation."""
