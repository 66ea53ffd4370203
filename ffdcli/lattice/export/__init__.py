"""Lattice files written: solved ones, starters, and drags as successions."""
