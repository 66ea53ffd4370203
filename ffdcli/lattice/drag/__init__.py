"""Direct manipulation: points of the object are moved, control points or weights follow."""
