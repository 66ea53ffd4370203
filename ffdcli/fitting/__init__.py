"""Polynomial volumes fitted to maps that are no polynomials."""
