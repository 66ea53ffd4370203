"""Volumes: the deformations of lattice boxes, by B-splines or on octrees, one protocol for all."""
