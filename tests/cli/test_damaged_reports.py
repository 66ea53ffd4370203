"""Damaged reports for `--against`: taken, or refused by name; never another exception."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli import read_mesh
from ffdcli.cli.verify import _read_report
from ffdcli.errors import FileError
from ffdcli.verify.file import allowed_deviation
from ffdcli.verify.regions import fit_bounds
from support.damage import BITS, damage
from support.jobs import obj
from support.mesh_models import CORNERS, QUADS

FIT = {"bound": 0.5, "lattices": [{"lattice": 0, "bound": 0.25}, {"lattice": -1, "bound": 0.5}]}
REPORT = {"max_error": 0.125, "plane_deviation": 0.0, "interpolation_error": 0.25, "fit": FIT}
GOOD = json.dumps(REPORT).encode()
JSON_BITS = (*BITS, b"{", b"}", b"[", b"]", b'"', b",", b"null", b"true", b"NaN", b"Infinity")


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    path = tmp_path_factory.mktemp("mesh") / "cube.obj"
    path.write_text(obj(CORNERS, QUADS))
    return read_mesh(path)


def stated(path, mesh):
    report = _read_report(path)
    return allowed_deviation(report, path, mesh), fit_bounds(report)


def test_the_report_is_taken_undamaged(tmp_path, mesh):
    path = tmp_path / "report.json"
    path.write_bytes(GOOD)
    assert stated(path, mesh) == (0.375, {0: 0.25, -1: 0.5})


@settings(max_examples=200, deadline=None, derandomize=True, database=None)
@given(data=st.data())
def test_damaged_reports(tmp_path_factory, mesh, data):
    path = tmp_path_factory.getbasetemp() / "report.json"
    path.write_bytes(damage(GOOD, data, JSON_BITS))
    refused = None
    try:
        allowed, bounds = stated(path, mesh)
    except FileError as error:
        refused = error
    if refused is None:
        assert 0 < allowed < float("inf")
        assert all(0 <= bound < float("inf") for bound in bounds.values())
        return
    assert refused.file == str(path)
    assert refused.hint
