"""Volumes of local functions on octrees and T-lattices, and the map that inverts one."""
