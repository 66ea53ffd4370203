"""Pictures: a scene of plain arrays, drawn into a web page or a PNG."""
