"""STEP files (ISO 10303-21) written from boundary representations, without OpenCascade."""
