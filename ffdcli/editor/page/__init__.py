"""The page of `ffd edit`: server, scene, panels and mouse; the only place that knows viser."""
