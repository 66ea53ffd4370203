"""Materials of a glTF file: names, base colours, and the place of their texture coordinates."""

from __future__ import annotations

from dataclasses import dataclass

from ffdcli.labels import Material
from ffdcli.mesh.io.gltf.container import TEXTURE_TRANSFORM
from ffdcli.mesh.io.gltf.entries import Entry
from ffdcli.mesh.io.text_numbers import parse_colour

Pair = tuple[float, float]


@dataclass(frozen=True)
class Look:
    """Where the image of a material takes its texture coordinates from.

    Parameters
    ----------
    texture : int
        Number of the set.
    scale, offset : (float, float)
        Factors, and what is added then.
    turned : bool
        Whether they are turned as well: how, the standard and its viewers see differently.
    """

    texture: int = 0
    scale: Pair = (1.0, 1.0)
    offset: Pair = (0.0, 0.0)
    turned: bool = False


def read_materials(root: Entry) -> tuple[tuple[Material, ...], list[Look]]:
    """Materials with colours in sRGB, and the look of each."""
    entries = root.entries("materials")
    return (
        tuple(_material(number, each) for number, each in enumerate(entries)),
        [_look(each.entry("pbrMetallicRoughness").entry("baseColorTexture")) for each in entries],
    )


def _material(number: int, entry: Entry) -> Material:
    # Without a factor the colour comes from a texture.
    factor = entry.entry("pbrMetallicRoughness").numbers("baseColorFactor", 4)
    colour = None if factor is None else parse_colour(factor[:3].tolist())
    if colour is not None:
        colour = (_encoded(colour[0]), _encoded(colour[1]), _encoded(colour[2]))
    return Material(entry.text("name") or f"material {number + 1}", colour)


def _look(texture: Entry) -> Look:
    number = texture.whole("texCoord", 0)
    moved = texture.extension(TEXTURE_TRANSFORM)
    if moved is None:
        return Look(number)
    turn = Entry({"rotation": [moved.values.get("rotation", 0)]}, moved.place).numbers("rotation")
    scale, offset = moved.numbers("scale", 2), moved.numbers("offset", 2)
    return Look(
        moved.whole("texCoord", number),
        (1.0, 1.0) if scale is None else (float(scale[0]), float(scale[1])),
        (0.0, 0.0) if offset is None else (float(offset[0]), float(offset[1])),
        turn is not None and bool(turn.any()),
    )


# Colours of glTF are linear; those of `Material` are sRGB (IEC 61966-2-1).
def _encoded(linear: float) -> float:
    return 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055
