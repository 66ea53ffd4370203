"""From mesh and volume to exact trimmed surfaces: planes, cut, regions, patches and curves."""
