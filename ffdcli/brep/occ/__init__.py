"""OpenCascade: building shapes, checking, writing and reading them; nothing else knows it."""
