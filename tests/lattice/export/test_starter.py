"""Starter lattices of `ffd new` and the JSON Schema of the lattice file."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ffdcli import read_lattice, read_mesh
from ffdcli.errors import LatticeError
from ffdcli.lattice import OctreeStart, json_schema, parse_lattice, starter_text
from ffdcli.lattice.file.edit_models import EDITS
from ffdcli.lattice.file.source import parse_yaml
from ffdcli.lattice.file.spec import LatticeSpec, OctreeSpec
from support.commands import ffd
from support.jobs import obj
from support.mesh_models import CORNERS, QUADS

BOUNDS = np.array([[0.0, -1.0, 2.0], [3.0, 1.0, 10.0]])
TRIANGLES = np.array([[BOUNDS[0], [3.0, -1.0, 2.0], BOUNDS[1]]])


def starter(**changes):
    facts = {"mesh": "part.obj", "bounds": BOUNDS, "delta": 1e-9, "unit": None}
    return starter_text(**{**facts, **changes})


def settled(text):
    return parse_lattice(*parse_yaml(text)).settle(bounds=BOUNDS, triangles=TRIANGLES, delta=1e-9)


def test_starter_holds_every_key_and_rests():
    text = starter()
    lattice = settled(text)
    assert np.array_equal(lattice.volume.net, lattice.volume.rest_points)
    assert lattice.unit == "mm"
    for key, field in LatticeSpec.model_fields.items():
        assert f"\n{key}:" in text
        assert field.description is not None
    assert "{min: [0.0, -1.0, 2.0], max: [3.0, 1.0, 10.0]}" in text
    assert max(map(len, text.splitlines())) <= 100


@pytest.mark.parametrize("name", [name for name in EDITS if name not in ("net", "weights")])
def test_every_example_works_when_uncommented(name):
    text = starter()
    # A peak is crimped where one has been raised.
    names = ["hammer", "crimp"] if name == "crimp" else [name]
    active = re.sub(rf"^  # - ({'|'.join(names)}):", r"  - \1:", text, flags=re.MULTILINE)
    assert active != text
    if name in ("weight", "crimp"):
        active = active.replace("\nvolume: bspline", "\nvolume: nurbs")
    lattice = settled(active)
    assert len(lattice.member.spec.edits) == len(names)
    if name == "crimp":
        assert np.any(lattice.weights != 1)
    elif name == "weight":
        assert np.count_nonzero(lattice.weights != 1) == 1
    elif name != "move_knots":
        assert np.any(lattice.volume.net != lattice.volume.rest_points)


@pytest.mark.parametrize(
    ("unit", "want"), [("inch", "inch"), (None, "mm"), ("parsec", None), ("m", "m")]
)
def test_unit_is_the_meshs(unit, want):
    assert settled(starter(unit=unit)).unit == want


@given(st.text(min_size=1))
def test_any_mesh_name_keeps_the_starter_valid(name):
    if any(
        ord(c) < 32 or 0x7F <= ord(c) < 0xA0 or 0xD800 <= ord(c) < 0xE000 or ord(c) > 0xFFFD
        for c in name
    ):
        return
    settled(starter(mesh=name))


def test_schema_describes_every_key():
    schema = json_schema()
    assert schema["required"] == ["version"]
    assert list(schema["properties"]) == [*LatticeSpec.model_fields, "lattices"]
    assert all("description" in each for each in schema["properties"].values())
    assert schema["additionalProperties"] is False
    assert len(schema["properties"]["edits"]["items"]["oneOf"]) == len(EDITS)


OCTREES = ("tspline", "hierarchical")


def octree_starter(volume, depth=2):
    return starter(octree=OctreeStart(volume, depth, TRIANGLES[0, 2]))


@pytest.mark.parametrize("volume", OCTREES)
def test_starters_on_octrees_hold_their_keys_and_rest(volume):
    text = octree_starter(volume, 3)
    lattice = settled(text)
    assert np.array_equal(lattice.points, lattice.volume.rest_points)
    assert lattice.volume.levels.max() == 3
    for key in OctreeSpec.model_fields:
        wanted = volume == "tspline" or key not in ("weights", "cells")
        wanted &= key not in ("max_depth", "max_points")
        assert (f"\n  {key}: " in text) == wanted
    for key in ("points", "knots", "ends", "border"):
        assert f"\n{key}:" not in text


@pytest.mark.parametrize("volume", OCTREES)
def test_their_examples_work_when_uncommented(volume):
    text = octree_starter(volume)
    names = re.findall(r"^  # - (\w+):", text, flags=re.MULTILINE)
    assert {"move", "transform", "drag", "hammer"} <= set(names)
    assert ("weight" in names) == (volume == "tspline")
    for name in set(names) - {"net", "weights"}:
        # A peak is crimped where one has been raised.
        chosen = "hammer|crimp" if name == "crimp" else name
        active = re.sub(rf"^  # - ({chosen}):", r"  - \1:", text, flags=re.MULTILINE)
        lattice = settled(active)
        at_rest = lattice.scaled(0)
        moved = np.any(lattice.points != at_rest.points)
        assert moved or (name == "weight" and np.any(lattice.weights != at_rest.weights))


def test_new_writes_lattices_that_run(tmp_path):
    import trimesh

    mesh = tmp_path / "part.obj"
    trimesh.creation.box([1, 2, 3]).export(mesh)
    for volume in ("bspline", *OCTREES):
        out, step = tmp_path / f"{volume}.yaml", tmp_path / f"{volume}.step"
        depth = () if volume == "bspline" else ("--octree-depth", 1)
        ffd("new", mesh, "--volume", volume, *depth, "-o", out)
        ffd("deform", mesh, out, "-o", step)
        out.write_text(out.read_text().replace("  # - move:", "  - move:"))
        ffd("deform", mesh, out, "-o", step)
        assert step.stat().st_size
    run = ffd("new", mesh, "--octree-depth", 2, status=2)
    assert "needs --volume tspline" in run.output


def test_new_refuses_what_deform_would(tmp_path):
    mesh, out = tmp_path / "part.obj", tmp_path / "out.yaml"
    mesh.write_text(obj(CORNERS, QUADS))
    for volume in OCTREES:
        arguments = ("new", mesh, "--volume", volume, "--octree-depth", 8, "-o", out)
        refusal = ffd(*arguments, status=1).output
        assert "octree.depth: this octree would have at least" in refusal
        assert not out.exists()


def test_the_examples_of_a_peak_raise_it_where_normals_cancel_inside(tmp_path):
    mesh, out = tmp_path / "part.obj", tmp_path / "out.yaml"
    mesh.write_text(obj(CORNERS, QUADS))
    ffd("new", mesh, "-o", out)
    text = out.read_text().replace("volume: bspline", "volume: nurbs")
    out.write_text(re.sub(r"^  # - (hammer|crimp):", r"  - \1:", text, flags=re.MULTILINE))
    lattice = read_lattice(out, read_mesh(mesh))
    top = lattice.volume.evaluate(np.array([[0.5, 0.5, 1.0]]))
    assert top == pytest.approx(np.array([[0.5, 0.5, 1.1]]))
    out.write_text("version: 1\nedits:\n- hammer: {point: [0.5, 0.5, 0.5], height: 0.1}\n")
    with pytest.raises(LatticeError, match="face all ways") as caught:
        read_lattice(out, read_mesh(mesh))
    assert caught.value.key == "edits[0].hammer.point"
