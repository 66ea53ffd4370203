"""three.js, from the package that brings it: trimesh's own viewer carries it."""

from __future__ import annotations

import zipfile
from functools import cache
from importlib import resources

from ffdcli.errors import FfdError

_END = "THREE.TrackballControls=TrackballControls;})();"


@cache
def three_js() -> str:
    """The scripts of three.js and its trackball controls, to be put into a page.

    Raises
    ------
    FfdError
        The installed trimesh carries another viewer.
    """
    folder = resources.files("trimesh").joinpath("resources", "templates")
    try:
        with (
            folder.joinpath("viewer.zip").open("rb") as stream,
            zipfile.ZipFile(stream) as archive,
        ):
            template = archive.read("viewer.html.template").decode("utf-8")
        begin = template.index("<script>") + len("<script>")
        return template[begin : template.index(_END, begin) + len(_END)]
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        raise FfdError(
            "the installed trimesh does not carry the three.js that pages are drawn with",
            hint="install a trimesh 5 release, or write a .png",
        ) from None
