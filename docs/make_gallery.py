"""Make the gallery again, pictures and page: `python docs/make_gallery.py [NAME ...]`.

Without names every picture is drawn. The page lists those that are there.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ffdcli import deform, prepare, read_lattice, read_mesh, read_part
from ffdcli.view.before_after import before_and_after
from ffdcli.view.camera import DIRECTION
from ffdcli.view.deformation_scene import scene_of
from ffdcli.view.draw import draw
from ffdcli.view.eight_panels import eight_panels
from ffdcli.view.error_map import error_panel
from ffdcli.view.part_scene import scene_of_part

HERE = Path(__file__).parent
SAMPLES = HERE.parent / "samples"
WIDTH = 1200
Direction = tuple[float, float, float]


@dataclass(frozen=True)
class Picture:
    """One picture of the gallery: what is drawn, from where, and what to say of it."""

    model: str
    lattice: str
    words: str
    direction: Direction = DIRECTION
    kind: str = "view"


PICTURES = {
    "wall-bracket": Picture(
        "cad/bracket.step",
        "cad/bracket.yaml",
        "A CAD part: the seat of a wall bracket lowered by 15 mm. It moves as one, so its top "
        "stays a plane and its bore a cylinder; the plate is outside the lattice and stays to the "
        "bit.",
        kind="part",
    ),
    "bracket": Picture(
        "bracket.obj",
        "bracket.yaml",
        "The foot of a bracket bent to sit on a tube. The lattice spans the foot only; grey "
        "control points are locked, so the upright stays as it is, to the last bit.",
    ),
    "bottle": Picture(
        "bottle.obj", "bottle.yaml", "A waist and a twist, inner wall included.", (0.55, -1.0, 0.3)
    ),
    "handle": Picture(
        "handle.obj",
        "handle.yaml",
        "Finger hollows pressed into a straight bar; the join is smooth in curvature.",
        (0.25, -1.0, -0.35),
    ),
    "creature": Picture(
        "creature.ply",
        "creature.yaml",
        "An organic model of 1828 triangles, its control points chosen by place.",
        (0.75, -1.0, 0.35),
    ),
    "cup": Picture(
        "drags/cylinder.obj",
        "drags/cup.yaml",
        "A cup from a cylinder: arrows are drags, read from a table; the lattice follows with the "
        "least change.",
        (0.4, -1.0, 0.45),
    ),
    "fish": Picture(
        "drags/fish.obj", "drags/fish-7.yaml", "A fish, its tail dragged.", (0.6, -1.0, 0.5)
    ),
    "compare": Picture(
        "drags/cylinder.obj",
        "drags/cup.yaml",
        "`ffd view --compare`: what plain deformation, subdivision, the previous exact methods and "
        "this one make of a mesh (the panels of Feng et al. 2002, Figs. 7-13).",
        (0.4, -1.0, 0.45),
        "compare",
    ),
    "error": Picture(
        "drags/cylinder.obj",
        "drags/cup.yaml",
        "`ffd view --error vertices`: how far the usual deformation of vertices is from the exact "
        "surface.",
        (0.4, -1.0, 0.45),
        "error",
    ),
}


def make(name: str, picture: Picture) -> bytes:
    """Draw one picture."""
    if picture.kind == "part":
        part = read_part(SAMPLES / picture.model)
        lattice = read_lattice(SAMPLES / picture.lattice, part)
        panels = before_and_after(scene_of_part(lattice, deform(part, lattice)))
        return draw(panels, width=WIDTH, direction=picture.direction)
    mesh = read_mesh(SAMPLES / picture.model)
    lattice = read_lattice(SAMPLES / picture.lattice, mesh)
    if picture.kind == "compare":
        plan = prepare(mesh, lattice, patches="paper")
        panels = eight_panels(plan, lattice)
        return draw(panels, width=WIDTH, columns=4, direction=picture.direction)
    if picture.kind == "error":
        panel = error_panel(mesh, lattice, "vertices")
        return draw([panel], width=WIDTH * 2 // 3, direction=picture.direction)
    scene = scene_of(mesh, lattice, deform(mesh, lattice), deviations=False)
    return draw(before_and_after(scene), width=WIDTH, direction=picture.direction)


def page() -> str:
    """The gallery's page."""
    parts = ["# Gallery\n", "Made by `python docs/make_gallery.py` from the samples.\n"]
    for name, picture in PICTURES.items():
        files = f"samples/{picture.model} samples/{picture.lattice}"
        options = {"compare": " --compare", "error": " --error vertices"}.get(picture.kind, "")
        parts += [
            f"## {name.replace('-', ' ').capitalize()}\n",
            f"![{picture.words}](images/{name}.png)\n",
            f"{picture.words}\n",
            f"```sh\nffd view {files}{options} -o {name}.png\n```\n",
        ]
    return "\n".join(parts)


def main(names: list[str], say: Callable[[str], None] = print) -> None:
    """Draw the named pictures, or all, and write the page."""
    for name in names or list(PICTURES):
        path = HERE / "images" / f"{name}.png"
        path.write_bytes(make(name, PICTURES[name]))
        say(str(path))
    (HERE / "gallery.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
