"""CAD files written by OpenCascade in full precision."""
