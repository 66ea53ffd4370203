"""Faults of a mesh: found, described and repaired."""
