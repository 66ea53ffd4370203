"""Surfaces that several faces trim stand in a file once; files are read as text here."""

import json
import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from ffdcli import deform
from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.check import kernel_check
from ffdcli.brep.occ.reading.read import read_cad, record_of
from ffdcli.brep.occ.writing import shared
from ffdcli.brep.occ.writing.write import write_cad
from support import brep_models as models
from support.commands import ffd

# Extension and options of every way to write.
WAYS = {
    "ap203": (".step", ["--schema", "ap203"]),
    "ap214": (".step", []),
    "ap242": (".step", ["--schema", "ap242"]),
    "short": (".step", ["--tolerance", "0.001"]),
    "without pcurves": (".step", ["--target", "rhino"]),
    "iges": (".iges", []),
    "faces": (".iges", ["--iges-mode", "faces"]),
    "brep": (".brep", []),
}
KINDS = ["ap214", "iges", "faces", "brep"]
LATTICE = """\
volume: {volume}
degree: [2, 1, 2]
points: [4, 3, 4]
{more}
edits:
  - move: {{at: [1, 1, 1], by: [0, 0, 0.3]}}
"""
# The tips of the teeth are above the box, and the last tooth is beside it.
HALF = "box: {min: [-1, -1, -1], max: [7.5, 4, 1.5]}\nborder: c0"
LATTICES = {
    "whole": LATTICE.format(volume="bspline", more=""),
    "half": LATTICE.format(volume="bspline", more=HALF),
    "rational": LATTICE.format(volume="nurbs", more="") + "  - weight: {at: [1, 1, 1], value: 3}\n",
}


def comb(teeth, y=0, first=1):
    """Lines of an OBJ file: a comb whose tips, and the gaps between, are coplanar."""
    profile = [(0, 0), (2 * teeth - 1, 0)]
    for k in reversed(range(teeth)):
        profile += [(2 * k + 1, 2), (2 * k, 2)]
        profile += [(2 * k, 1), (2 * k - 1, 1)] if k else []
    count = len(profile)
    lines = [f"v {x} {y + side} {z}" for side in (0, 3) for x, z in profile]
    faces = [range(count), range(2 * count - 1, count - 1, -1)]
    for i in range(count):
        j = (i + 1) % count
        faces.append([j, i, count + i, count + j])
    return [*lines, *("f " + " ".join(str(first + i) for i in face) for face in faces)]


def surfaces_in(path):
    """Numbers of B-spline surfaces and planes in a file, by its text."""
    text = path.read_text()
    if path.suffix == ".step":
        return text.count("B_SPLINE_SURFACE_WITH_KNOTS"), text.count("= PLANE(")
    if path.suffix == ".iges":
        kinds = entities_of_iges(text)
        return kinds[128], kinds[108] + kinds[190]
    table = text[text.index("\nSurfaces ") + 10 : text.index("\nTriangulations ")].split("\n")
    # A record begins with its kind; a plane has one line.
    planes = sum(re.match(r"1 (\S+ ){11}\S+ *$", line) is not None for line in table[1:])
    return int(table[0]) - planes, planes


def entities_of_iges(text):
    """Number of entities of each type: two lines of the directory for each."""
    lines = [line for line in text.splitlines() if line[72] == "D"]
    return Counter(int(line[:8]) for line in lines[::2])


def entities_of_step(text):
    """Number of entities of each type, of complex ones by their first type; and references."""
    entities = dict(re.findall(r"(?ms)^#(\d+) = (.*?);$", text))
    kinds = Counter(re.match(r"\(?\s*(\w+)", entity)[1] for entity in entities.values())
    used = {number for entity in entities.values() for number in re.findall(r"#(\d+)", entity)}
    return kinds, set(map(int, entities)), set(map(int, used))


@pytest.mark.parametrize(
    ("lattice", "patches", "way"),
    [
        *(("half", "bezier", way) for way in WAYS),
        *((lattice, "bezier", way) for lattice in ("whole", "rational") for way in KINDS),
        *(("half", patches, way) for patches in ("merged", "paper") for way in KINDS),
    ],
)
def test_files_hold_as_many_surfaces_as_the_report_and_info_say(lattice, patches, way, tmp_path):
    extension, options = WAYS[way]
    path, mesh, file = tmp_path / f"comb{extension}", tmp_path / "comb.obj", tmp_path / "comb.yaml"
    file.write_text("version: 1\n" + LATTICES[lattice])
    mesh.write_text("\n".join([*comb(6), *comb(4, y=10, first=49), ""]))
    options = [*options, "--patches", patches, "--json", "--report", tmp_path / "report.json"]
    report = json.loads(ffd("deform", mesh, file, "-o", path, *options).stdout)
    info = json.loads(ffd("info", path, "--json").stdout)
    splines, planes = surfaces_in(path)
    assert splines + planes == report["patches"]
    assert planes == report["degrees"].get("plane", 0)
    for name in ("faces", "degrees", "control_points", "rational"):
        assert info[name] == report[name], name
    assert report["patches"] < report["faces"]
    model = read_cad(path)
    assert kernel_check(model.shape).valid
    ffd("verify", path, mesh, file, "--against", tmp_path / "report.json")


@pytest.mark.parametrize("extension", [".step", ".iges"])
def test_only_the_surfaces_that_give_way_go(extension, job, tmp_path, monkeypatch):
    (tmp_path / "two.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n")
    lines = ["mtllib two.mtl", "o one", "usemtl red", *comb(6), "o two"]
    two = comb(4, y=10, first=49)
    lines += [*two[:-8], "usemtl blue", "g tips", *two[-8:], ""]
    result = deform(*job(LATTICES["whole"], mesh="\n".join(lines)), patches="bezier")
    ours, plain = tmp_path / f"ours{extension}", tmp_path / f"plain{extension}"
    result.write(ours, schema="ap242")
    monkeypatch.setattr(shared, "shared_surfaces", lambda *_, **__: [])
    result.write(plain, schema="ap242")
    if extension == ".iges":
        ours, plain = (entities_of_iges(path.read_text()) for path in (ours, plain))
        assert plain - ours == {128: plain[510] - result.brep.surface_count}
        assert not ours - plain
        return
    (ours, numbers, used), (plain, *_) = (
        entities_of_step(path.read_text()) for path in (ours, plain)
    )
    assert ours["STYLED_ITEM"] > 1
    assert set(plain - ours) == {"B_SPLINE_SURFACE_WITH_KNOTS", "CARTESIAN_POINT"}
    assert not ours - plain
    # Nothing is left that nothing refers to, and no number is left out.
    assert numbers == set(range(1, len(numbers) + 1))
    roots = "DEFINITION|PRODUCT_RELATED|REPRESENTATION|PRESENTATION|DEPENDENT"
    kinds = {
        re.match(r"\(?\s*(\w+)", entity)[1]
        for number, entity in re.findall(
            r"(?ms)^#(\d+) = (.*?);$", (tmp_path / "ours.step").read_text()
        )
        if int(number) not in used
    }
    assert all(re.search(roots, kind) for kind in kinds), kinds


def test_the_number_of_processes_does_not_matter(job, tmp_path, monkeypatch):
    monkeypatch.setattr("ffdcli.brep.occ.writing.print_step._WORTH", 50)
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    lines = "\n".join([*comb(6), ""])
    shape = build_shape(deform(*job(LATTICES["whole"], mesh=lines), patches="bezier").brep)
    contents = []
    for processes in (1, 2):
        write_cad(shape, tmp_path / "comb.step", processes=processes)
        contents.append((tmp_path / "comb.step").read_bytes())
    assert contents[0] == contents[1]


@pytest.mark.parametrize("lattice", LATTICES)
def test_another_kernel_reads_them(lattice, job, tmp_path):
    """Pykentron, written in Rust."""
    pykentron = pytest.importorskip("pykentron")
    mesh = "\n".join([*comb(6), *comb(4, y=10, first=49), ""])
    result = deform(*job(LATTICES[lattice], mesh=mesh), patches="bezier")
    result.write(tmp_path / "comb.step")
    solids = pykentron.importers.importStep(str(tmp_path / "comb.step")).val().Solids()
    assert sum(len(solid.Faces()) for solid in solids) == result.brep.face_count
    for solid, mass in zip(solids, result.masses, strict=True):
        assert solid.isValid()
        assert all(shell.Closed() for shell in solid.Shells())
        assert solid.Volume() == pytest.approx(mass.volume, rel=1e-6)
        assert solid.Area() == pytest.approx(mass.area, rel=1e-6)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("mapping", [None, models.bumpy, models.projective])
def test_faces_side_by_side_on_one_surface(mapping, way, tmp_path):
    """The edge between them lies on that surface twice."""
    extension, _ = WAYS[way]
    brep = models.split_cube(mapping)
    path = tmp_path / f"cube{extension}"
    how = {"pcurves": way != "without pcurves", "iges_mode": "faces" if way == "faces" else "brep"}
    write_cad(build_shape(brep), path, **how)
    read = read_cad(path)
    assert kernel_check(read.shape).valid
    record = record_of(read)
    assert (record.face_count, record.surface_count) == (7, 6)
    assert sum(surfaces_in(path)) == 6


def test_equal_surfaces_that_are_written_apart_are_read_apart(tmp_path):
    """Files say which surfaces are one; equal numbers do not."""
    brep = models.split_cube(models.bumpy)
    (batch,) = brep.surfaces
    fields = ("u_knots", "v_knots", "poles")
    doubled = {name: getattr(batch, name)[[*range(6), 5]] for name in fields}
    apart = replace(
        brep,
        surfaces=(replace(batch, surfaces=np.arange(7), **doubled),),
        face_surface=np.arange(7),
    )
    for extension in (".step", ".iges", ".brep"):
        path = tmp_path / f"cube{extension}"
        write_cad(build_shape(apart), path)
        assert surfaces_in(path) == (7, 0)
        assert record_of(read_cad(path)).surface_count == 7
