"""Polynomial volumes fitted to maps without polynomial pieces."""
