"""Spline algebra on arrays: knots, Bernstein forms, spline spaces, composition."""
