"""Surfaces and curves with fewer control points, within a certified bound."""
