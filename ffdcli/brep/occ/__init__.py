"""OpenCascade, used here only: shapes are built, checked, written and read."""
