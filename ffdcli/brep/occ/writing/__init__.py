"""CAD files written by OpenCascade, every number in full precision."""
