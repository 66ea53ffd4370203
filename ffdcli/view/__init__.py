"""Pictures: a scene becomes a web page (page), panels become a PNG (draw)."""
