"""3MF files, decoded and encoded."""
