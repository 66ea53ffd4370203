"""Deforming volumes: knots, bases and control nets behind one protocol."""
