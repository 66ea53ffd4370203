"""Direct manipulation: control points or weights that move points of the object to targets."""
