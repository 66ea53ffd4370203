"""Exact trimmed surfaces of a deformed mesh: planes, cuts, regions, patches and curves."""
