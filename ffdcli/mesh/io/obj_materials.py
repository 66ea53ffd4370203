"""Material files of OBJ (.mtl): names, colours and images, decoded and encoded."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path

from ffdcli.labels import Material
from ffdcli.mesh.io.painted_mesh import Paint
from ffdcli.mesh.io.text_numbers import parse_colour

_STATEMENT = re.compile(rb"^[ \t]*(newmtl|Kd|map_Kd)[ \t]+([^\r\n]*)", re.MULTILINE)


def read_materials(folder: Path, names: tuple[str, ...]) -> tuple[dict[str, Material], list[str]]:
    """Materials by name, and a note for each file or image that is left out.

    Parameters
    ----------
    folder : Path
        Folder of the OBJ file.
    names : tuple of str
        What follows each ``mtllib``: one file name, which may have spaces, or several.
    """
    found: dict[str, Material] = {}
    notes = []
    files = [
        part
        for name in dict.fromkeys(names)
        for part in ([name] if (folder / name).is_file() else name.split())
    ]
    for name in files:
        path = folder / name.replace("\\", "/")
        try:
            data = path.read_bytes()
        except OSError:
            notes.append(f"the material file {name} cannot be read: its colours are left out")
            continue
        material = ""
        for kind, rest in _STATEMENT.findall(data):
            if kind == b"newmtl":
                material = name_in(rest)
                found.setdefault(material, Material(material))
            elif material not in found:
                continue
            elif kind == b"Kd":
                colour = parse_colour(rest.split()[:3]) or found[material].colour
                found[material] = replace(found[material], colour=colour)
            elif rest.startswith(b"-"):
                notes.append(f"the image of material {material} has options: it is left out")
            else:
                image = str(path.parent / name_in(rest).replace("\\", "/"))
                found[material] = replace(found[material], image=image)
    return found, notes


def name_in(rest: bytes) -> str:
    """The name in the rest of a statement. A comment begins with a space: names may hold ``#``."""
    return re.sub(rb"(^|\s)#.*", b"", rest).decode("utf-8", "replace").strip()


def encode_materials(paint: Paint, folder: Path) -> bytes:
    """A material file in a folder; paths of images are relative to it."""
    lines = []
    for name, material in zip(paint.names, paint.materials, strict=True):
        lines.append(f"newmtl {name}")
        if material.colour is not None:
            lines.append("Kd " + " ".join(map(repr, map(float, material.colour))))
        if material.image is not None:
            lines.append(f"map_Kd {_relative(material.image, folder)}")
    return ("\n".join(lines) + "\n").encode()


def _relative(image: str, folder: Path) -> str:
    try:
        return Path(os.path.relpath(image, folder)).as_posix()
    except ValueError:  # on another drive
        return Path(image).absolute().as_posix()
