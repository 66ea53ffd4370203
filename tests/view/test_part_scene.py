"""Scenes of CAD parts: one face each, the part before and after at the same parameters."""

import json

import numpy as np
import pytest

from ffdcli import deform, read_lattice, read_part
from ffdcli.deformation import Deformation
from ffdcli.view.part_scene import scene_of_part
from support.commands import ffd
from support.parts import write_part

LATTICE = """\
version: 1
volume: {volume}
degree: [2, 2, 2]
points: [3, 3, 3]
box: {{min: [0, -11, -3], max: [21, 11, 9]}}
border: c0
edits:
  - move: {{at: [2, 2, 2], by: [1, 2, 3]}}
"""
WEIGHT = "  - weight: {at: [2, 1, 2], value: 2}\n"


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Files of a filleted plate and of a lattice over half of it."""
    folder = tmp_path_factory.mktemp("part")
    (folder / "lattice.yaml").write_text(LATTICE.format(volume="bspline"), encoding="utf-8")
    return write_part("plate", folder), folder / "lattice.yaml"


@pytest.mark.parametrize("volume", ["bspline", "nurbs"])
def test_points_before_and_after_have_the_same_parameters(files, tmp_path, volume):
    part = read_part(files[0])
    file = tmp_path / "lattice.yaml"
    text = LATTICE.format(volume=volume) + WEIGHT * (volume == "nurbs")
    file.write_text(text, encoding="utf-8")
    lattice = read_lattice(file, part)
    result = deform(part, lattice)
    scene = scene_of_part(lattice, result)
    rest, after = scene.after.frames[0], scene.after.frames[-1]
    off = np.abs(Deformation.of(lattice, part.delta).images(rest) - after).max()
    # Points on edges are those of the edge's curve, which is fitted by itself.
    assert off < 3 * result.max_error
    assert np.abs(rest - after).max() > 0.1
    assert scene.before is not None
    assert set(scene.before.face.tolist()) == set(range(part.face_count))
    assert len(scene.faces.degrees) == part.face_count
    assert len(scene.amplitudes) == (2 if volume == "bspline" else 11)
    assert scene.facts.startswith(f"{part.face_count} faces: ")


def test_command_draws_parts(files, tmp_path):
    for extension in (".png", ".html"):
        out = tmp_path / f"out{extension}"
        ffd("view", *files, "-o", out)
        assert out.stat().st_size > 10_000
    text = out.read_text(encoding="utf-8").split('id="scene">')[1]
    scene = json.loads(text.split("</script>")[0])
    assert "a cylinder" in scene["degrees"]
    assert "a plane" in scene["degrees"]
