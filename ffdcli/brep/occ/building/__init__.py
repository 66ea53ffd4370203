"""OpenCascade shapes built from boundary representations, through OpenCascade's binary stream."""
