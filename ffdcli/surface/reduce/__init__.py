"""Reduction of surfaces and curves within certified bounds."""
