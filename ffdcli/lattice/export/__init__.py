"""Lattice files as output: solved lattices, starter files, drags as successions."""
