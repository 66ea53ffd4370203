"""CAD files read by OpenCascade into plain arrays, nothing repaired."""
