"""Faults of a mesh: inspection, messages and repair."""
