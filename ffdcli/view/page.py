"""Write a scene as a self-contained web page: no server, no network, no other files."""

from __future__ import annotations

import base64
import html
import json
from importlib import resources
from string import Template
from typing import Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.view import colours
from ffdcli.view.camera import DIRECTION
from ffdcli.view.scene import Scene, Skin
from ffdcli.view.three import three_js

_COLOURS = {
    "before": colours.BEFORE,
    "line": colours.LINE,
    "lattice": colours.LATTICE,
    "point": colours.POINT,
    "locked": colours.LOCKED,
    "hidden": colours.HIDDEN,
    "drag": colours.DRAG,
    "cell": colours.CELL,
}


def page(scene: Scene) -> str:
    """HTML of a scene: mouse control, layers, amplitude, facts of the face under the pointer."""
    files = resources.files("ffdcli.view")
    parts = {name: files.joinpath(name).read_text("utf-8") for name in _FILES}
    return Template(parts["page.html"]).substitute(
        title=html.escape(scene.title),
        style=parts["page.css"],
        three=three_js(),
        scene=_json(scene),
        script=parts["page.js"],
    )


_FILES = ("page.html", "page.css", "page.js")


def _json(scene: Scene) -> str:
    """The scene as JSON; coordinates relative to the middle, in units of half the diagonal."""
    plain, whole = (scene.bounds(hidden_points=hidden) for hidden in (False, True))
    middle = plain.mean(axis=0)
    half = _radius(plain) or 1.0

    def place(points: Floats) -> str:
        return _base64(((points - middle) / half).astype("<f4"))

    def skin(part: Skin) -> dict[str, Any]:
        return {
            "frames": [place(frame) for frame in part.frames],
            "triangles": _base64(part.triangles.astype("<u4")),
            "face": _base64(part.face.astype("<u4")),
            "outline": _base64(part.outline.astype("<u4")),
        }

    names = sorted(set(scene.faces.degrees))
    number = {name: i for i, name in enumerate(names)}
    deviation = scene.faces.deviation
    content = {
        "title": scene.title,
        "unit": scene.unit,
        "facts": scene.facts,
        "amplitudes": scene.amplitudes.tolist(),
        "sight": [
            [*((bounds.mean(axis=0) - middle) / half).tolist(), _radius(bounds) / half]
            for bounds in (plain, whole)
        ],
        "hidden_count": scene.hidden_count,
        "hidden_points": scene.hidden_points,
        "direction": DIRECTION,
        "colours": _COLOURS,
        "palette": colours.FACES,
        "degrees": [_degree_label(name) for name in names],
        "before": None if scene.before is None else skin(scene.before),
        "after": skin(scene.after),
        "faces": {
            "degree": _base64(np.array([number[n] for n in scene.faces.degrees], dtype="<u4")),
            "deviation": None if deviation is None else _base64(deviation.astype("<f4")),
            "colour": _base64(scene.faces.colour.astype("<u4")),
        },
        "lattices": [
            {
                "frames": [place(frame) for frame in net.frames],
                "lines": _base64(net.lines.astype("<u4")),
                "locked": _base64(net.locked.astype("u1")),
                "hidden": _base64(net.hidden.astype("u1")),
            }
            for net in scene.lattices
        ],
        "drags": place(scene.drags) if len(scene.drags) else None,
        "cells": place(scene.cells) if len(scene.cells) else None,
    }
    # Only `<` could end a script element.
    return json.dumps(content, ensure_ascii=False).replace("<", "\\u003c")


def _radius(bounds: Floats) -> float:
    """Radius of the ball around bounds (2, 3)."""
    return float(np.linalg.norm(bounds[1] - bounds[0])) / 2


def _degree_label(name: str) -> str:
    if name[0].isdigit():
        return f"degree {name.replace('x', ' × ')}"
    return f"{'an' if name[0] in 'aeiou' else 'a'} {name}"


def _base64(array: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
