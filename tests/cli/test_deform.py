"""`ffd deform` with a mesh as output: modes, report, options that do not fit, whole files."""

from __future__ import annotations

import json

import pytest

from ffdcli.mesh import inspect, read_mesh
from support.commands import ffd
from support.plain_files import CORNERS

BOX = f"""{CORNERS}\
g ends
f 4 3 2 1
f 5 6 7 8
g sides
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
"""
TWIST = "version: 1\nunit: cm\npoints: [4, 4, 4]\nedits:\n  - twist: {axis: w, angle: 40}\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "box.obj").write_text(BOX)
    (tmp_path / "twist.yaml").write_text(TWIST)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*args, status=0):
    return ffd("deform", "box.obj", "twist.yaml", *args, status=status)


@pytest.mark.parametrize("extension", ["stl", "obj", "ply", "off", "glb", "3mf"])
@pytest.mark.parametrize("mode", [None, "vertices", "uniform", "adaptive"])
def test_every_format_and_mode(folder, extension, mode):
    options = ["--mesh-mode", mode] if mode else []
    if mode != "vertices":
        options += ["--mesh-tolerance", 0.05]
    report = json.loads(run("-o", f"out.{extension}", *options, "--json").stdout)
    assert report["output"] == f"out.{extension}"
    assert report["mesh"] == {"vertices": 8, "polygons": 6, "bodies": 1, "closed": True}
    assert report["mesh_mode"] == (mode or "exact")
    assert (report["watertight"], report["exact"], report["unit"]) == (True, False, "cm")
    assert report["bytes"] == (folder / f"out.{extension}").stat().st_size
    assert set(report["seconds"]) >= {"read", "triangles", "write"}
    if mode == "vertices":
        assert report["tolerance"] is None
        assert (report["triangles"], report["vertices"]) == (12, 8)
        assert report["max_deviation"] > 0.1
    else:
        assert 0 < report["max_deviation"] <= report["tolerance"] == 0.05
    mesh = read_mesh(f"out.{extension}")
    assert inspect(mesh).closed
    assert mesh.polygon_count == report["triangles"]
    if extension in ("obj", "glb"):
        assert set(mesh.groups) == {"ends", "sides"}
    lost = (
        "3MF files name whole bodies only: names of groups within bodies are left out (ends, sides)"
    )
    assert (lost in " ".join(report["warnings"])) == (extension == "3mf")


def test_summary_for_people(folder):
    text = run("-o", "out.stl", "--mesh-tolerance", "0.05", "--report", "r.json").stdout
    report = json.loads((folder / "r.json").read_text())
    first, second = text.splitlines()
    assert first.startswith(f"out.stl: closed, {report['triangles']} triangles, ")
    assert first.endswith(" in cm")
    assert f"up to {report['max_deviation']:.2g} cm" in second


def test_units_and_metres(folder):
    plain = ("--mesh-mode", "vertices")
    run("-o", "a.3mf", "--unit", "inch", *plain)
    assert read_mesh("a.3mf").unit == "inch"
    assert "the unit of GLB files is the metre" in run("-o", "a.glb", *plain).stderr
    assert "metre" not in run("-o", "a.glb", "--unit", "m", *plain).stderr
    refused = run("-o", "b.3mf", "--unit", "mile", status=1)
    assert "3MF files cannot be in the unit 'mile'" in refused.stderr
    assert not (folder / "b.3mf").exists()


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (("-o", "a.stl", "--schema", "ap242"), "--schema needs an output in STEP"),
        (("-o", "a.stl", "--patches", "merged"), "--patches needs an output in STEP or IGES"),
        (("-o", "a.stl", "--iges-mode", "brep"), "--iges-mode needs an output in IGES"),
        (("-o", "a.step", "--mesh-mode", "uniform"), "--mesh-mode needs an output in a mesh"),
        (("-o", "a.brep", "--mesh-tolerance", "1"), "--mesh-tolerance needs an output in a"),
        (("-o", "a.obj", "--mesh-tolerance", "0"), "not in the range x>0"),
        (("-o", "a.obj", "--mesh-tolerance", "nan"), "not a finite number"),
        (("-o", "a.obj", "--mesh-tolerance", "inf"), "not a finite number"),
        (
            ("-o", "a.obj", "--mesh-mode", "vertices", "--mesh-tolerance", "1"),
            "vertices has no tolerance",
        ),
        (("-o", "a.obj", "--mesh-mode", "finest"), "'finest' is not one of"),
    ],
)
def test_options_that_do_not_fit(folder, args, message):
    before = set(folder.iterdir())
    assert message in run(*args, status=2).stderr
    assert set(folder.iterdir()) == before


def test_failures_leave_what_was_there(folder):
    (folder / "out.stl").write_text("before")
    refused = run("-o", "out.stl", "--mesh-tolerance", "1e-13", status=1)
    assert refused.stderr.startswith("error: a mesh within this tolerance needs more than")
    assert (folder / "out.stl").read_text() == "before"
    assert not list(folder.glob(".*"))
    unknown = run("-o", "out.xyz", status=1).stderr
    assert ".step" in unknown
    assert ".stl" in unknown
    (folder / "box.obj").write_text(BOX.replace("f 5 6 7 8\n", ""))
    assert "the mesh is open" in run("-o", "out.stl", "--require-solid", status=1).stderr
    assert "the mesh is open" in run(
        "-o", "out.stl", "--require-solid", "--mesh-mode", "adaptive", status=1
    ).stderr  # fmt: skip


TEXTURE = """\
vt 0 0
vt 1 0
vt 1 1
vt 0 1
"""


@pytest.mark.parametrize("mode", [None, "vertices", "uniform", "adaptive"])
def test_texture_coordinates_come_along_or_are_told(folder, mode):
    lines = (TEXTURE + BOX).splitlines()
    for n, line in enumerate(lines):
        if line.startswith("f "):
            lines[n] = "f " + " ".join(f"{v}/{k}" for k, v in enumerate(line.split()[1:], 1))
    (folder / "box.obj").write_text("\n".join([*lines, ""]))
    options = ["--mesh-mode", mode] if mode else []
    options += [] if mode == "vertices" else ["--mesh-tolerance", 0.1]
    for extension in ("obj", "ply", "glb"):
        told = run("-o", f"out.{extension}", *options).stderr
        assert "texture" not in told
        uv = read_mesh(f"out.{extension}").uv
        assert (uv.min(), uv.max()) == (0, 1)
    for extension, lost in (
        ("3mf", "texture coordinates"),
        ("stl", "names and texture coordinates"),
        ("off", "names and texture coordinates"),
    ):
        told = run("-o", f"out.{extension}", *options).stderr
        kind = extension.upper()
        assert f"{kind} files cannot hold {lost}: they are left out" in told
        assert read_mesh(f"out.{extension}").uv is None
