"""OpenCascade in a separate process, or in this one."""
