"""CAD files read by OpenCascade into plain arrays, without repairs."""
