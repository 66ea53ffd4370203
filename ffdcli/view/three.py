"""Source of three.js for web pages, from the package jupyter-threejs-sage."""

from __future__ import annotations

from functools import cache
from importlib import resources


@cache
def three_js() -> str:
    """Script of three.js and its orbit controls; it defines the global `THREE`.

    The package is SageMath's build of three.js. Its later versions keep the files of earlier ones.
    """
    folder = resources.files("jupyter_threejs_sage").joinpath("static", "r130")
    return folder.joinpath("three.min.js").read_text("utf-8")
