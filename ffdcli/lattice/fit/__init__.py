"""Fits: control points that take many points near their targets, by weighted least squares."""
