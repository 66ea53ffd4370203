"""Edits whose results are too large for sound arithmetic are refused, and cause no warnings."""

import json

import numpy as np
import pytest

from ffdcli.errors import LatticeError
from ffdcli.lattice.file.source import parse_yaml
from ffdcli.lattice.lattice_file import parse_lattice
from support.commands import ffd
from support.jobs import obj
from support.mesh_models import CORNERS, QUADS

TRIANGLES = np.array([[[1.0, 1.0, 1.0], [3.0, 1.0, 1.0], [1.0, 3.0, 2.0]]])
BOX = "version: 1\nvolume: nurbs\nbox: {min: [0, 0, 0], max: [4, 4, 4]}\nedits:\n"


def settled(edits):
    bounds = np.array([[1.0, 1.0, 1.0], [3.0, 3.0, 2.0]])
    lattice = parse_lattice(*parse_yaml(BOX + edits))
    return lattice.settle(bounds=bounds, triangles=TRIANGLES, delta=1e-9)


@pytest.mark.parametrize(
    "edits",
    [
        "- taper: {axis: u, factor: 1e20}\n" * 2,
        '- transform: {at: [":", ":", ":"], scale: [1e20, 1, 1]}\n' * 2,
        '- move: {at: [":", ":", ":"], by: [0, 0, 6e29]}\n' * 2,
    ],
)
def test_coordinates_that_grow_too_large_are_refused(edits, recwarn):
    with pytest.raises(LatticeError, match="too large") as caught:
        settled(edits)
    assert caught.value.key.startswith("edits[1]")
    assert not recwarn


@pytest.mark.parametrize("value", ["1e16", "1e30", "1e-16", "1e-300"])
def test_weights_too_far_from_1_are_refused(value, recwarn):
    with pytest.raises(LatticeError, match="there are weights from"):
        settled(f"- weight: {{at: [2, 2, 2], value: {value}}}\n")
    assert not recwarn


@pytest.mark.parametrize("value", [1e15, 1e-15])
def test_weights_within_the_limits_are_taken(value):
    lattice = settled(f"- weight: {{at: [2, 2, 2], value: {value!r}}}\n")
    assert lattice.members[0].weights[2, 2, 2] == value


def test_weights_at_the_limit_leave_reports_finite(tmp_path):
    mesh, lattice = tmp_path / "a.obj", tmp_path / "l.yaml"
    mesh.write_text(obj(CORNERS, QUADS))
    edit = "- weight: {at: [2, 2, 2], value: 1e15}\n"
    lattice.write_text(f"version: 1\nvolume: nurbs\nedits:\n{edit}")
    text = ffd("info", lattice, "--mesh", mesh, "--json").stdout
    found = json.loads(text, parse_constant=pytest.fail)["jacobian"]
    assert found == {"injective": "unproved", "bound": None, "global": "unproved"}
    written = ffd("deform", mesh, lattice, "-o", tmp_path / "a.brep", "--json").stdout
    report = json.loads(written, parse_constant=pytest.fail)
    assert report["jacobian"]["bound"] is None
    assert any("too far apart to bound det J" in warning for warning in report["warnings"])
