"""Spline algebra: knots, Bernstein forms, spline spaces, composition; arrays in, arrays out."""
