"""OpenCascade in processes of its own."""
