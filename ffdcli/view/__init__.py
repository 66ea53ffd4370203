"""Pictures: scenes and panels as plain arrays, drawn as a web page or a PNG."""
