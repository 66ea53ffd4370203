"""The page of report fields lists the fields of real reports, no more and no fewer."""

import json
import re

import pytest

from support import parts
from support.commands import ffd
from support.doc_pages import ROOT
from support.plain_files import CUBE

PAGE = (ROOT / "docs" / "reference" / "report.md").read_text(encoding="utf-8")
ALL = '[":", ":", ":"]'
# The middle goes up through the top.
PAIRS = ", ".join(
    f"{{from: [{x}, {y}, {z}], by: [0, 0, {6 if z == 1.5 else 0}]}}"
    for x in (0, 3)
    for y in (0, 3)
    for z in (0, 1.5, 3)
)
LATTICES = {
    "bend": "edits: [{bend: {axis: w, toward: u, angle: 20}}]",
    "mirrored": f"edits: [{{transform: {{at: {ALL}, scale: [-1, 1, 1]}}}}]",
    "folded": 'edits: [{move: {at: [":", ":", 1], by: [0, 0, 30]}}]',
    "drag": "edits: [{drag: {pairs: [{from: [1, 1, 2], by: [0, 0, 0.1]}, "
    "{from: [1, 2, 3], by: [0.1, 0, 0]}]}}]",
    "fitted": f"edits: [{{fit: {{pairs: [{PAIRS}]}}}}]",
    "weighted": "volume: nurbs\nedits: [{weight: {at: [1, 1, 1], value: 2}}]",
    "octree": "volume: tspline\noctree: {depth: 1}\n"
    "edits: [{move: {at: {index: 0}, by: [0, 0, 0.1]}}]",
    "inverse": "volume: tspline\noctree: {depth: 1, embedding: inverse}\n"
    "edits: [{move: {at: {index: 0}, by: [0, 0, 0.1]}}]",
    "several": "lattices:\n"
    "  - {box: {min: [-1, -1, 3], max: [4, 4, 5]}, degree: [2, 2, 2]}\n"
    "  - box: {min: [-1, -1, -1], max: [4, 4, 1]}\n"
    "    edits: [{drag: {pairs: [{from: [1, 1, 0], by: [0, 0, -0.1]}]}}]",
}
JOBS = """\
version: 1
output: "{lattice}.step"
jobs:
  - {mesh: cube.obj, lattice: bend.yaml, verify: true}
  - {mesh: cube.obj, lattice: drag.yaml, verify: {tolerance: 1.0e-300}}
  - {mesh: cube.obj, lattice: none.yaml}
"""


def fields(section):
    """Fields of a section of the page."""
    (text,) = re.findall(rf"^## {section}\n(.*?)(?=^## |\Z)", PAGE, flags=re.M | re.S)
    found = re.findall(r"^\| `([^`]+)` \|", text, flags=re.MULTILINE)
    assert len(set(found)) == len(found)
    return set(found)


def paths(value, listed, path=""):
    """Paths of all values, down to those that the page lists."""
    if isinstance(value, dict) and value and path not in listed:
        for name, inner in value.items():
            yield from paths(inner, listed, f"{path}.{name}" if path else name)
    elif isinstance(value, list) and value and isinstance(value[0], dict) and path not in listed:
        for inner in value:
            yield from paths(inner, listed, f"{path}[]")
    else:
        yield path


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reports")
    (folder / "cube.obj").write_text(CUBE)
    (folder / "jobs.yaml").write_text(JOBS)
    for name, text in LATTICES.items():
        (folder / f"{name}.yaml").write_text(f"version: 1\n{text}\n")
    return folder


@pytest.fixture
def report(folder, monkeypatch):
    monkeypatch.chdir(folder)

    def run(command, status=0):
        return json.loads(ffd(*command.split(), "--json", status=status).stdout)

    return run


def agree(section, reports):
    listed = fields(section)
    found = {path for report in reports for path in paths(report, listed)}
    assert found == listed, f"only in reports: {found - listed}; only listed: {listed - found}"


def test_errors(report):
    agree("Errors", [report("info none.obj", status=1)])


def test_deform_to_cad(report):
    runs = [
        "cube.obj bend.yaml -o bend.step --profile",
        "cube.obj bend.yaml -o bend.igs --patches paper",
        "cube.obj inverse.yaml -o fitted.step",
        "cube.obj mirrored.yaml -o mirrored.brep",
        "cube.obj folded.yaml -o folded.brep --no-check",
        "cube.obj fitted.yaml -o fits.brep --no-check",
    ]
    agree("ffd deform, to CAD", [report(f"deform {run}") for run in runs])


def test_deform_a_part(report, folder):
    parts.write_part("cylinder", folder)
    runs = [
        "cylinder.step bend.yaml -o bent.step --profile",
        "cylinder.step mirrored.yaml -o mirrored.igs",
        "cylinder.step folded.yaml -o folded.brep --no-check",
        "cylinder.step fitted.yaml -o fits.brep --no-check",
    ]
    agree("ffd deform, a CAD part", [report(f"deform {run}") for run in runs])
    told = [
        report(f"deform cylinder.step {name}.yaml --dry-run --profile")
        for name in ("bend", "mirrored", "folded", "fitted")
    ]
    agree("ffd deform --dry-run, a CAD part", told)


def test_deform_to_mesh(report, folder):
    parts.write_part("cylinder", folder)
    runs = [
        "cylinder.step bend.yaml -o bent.stl",
        "cube.obj bend.yaml -o bend.obj --profile",
        "cube.obj bend.yaml -o half.obj --mesh-mode vertices",
        "cube.obj inverse.yaml -o fitted.obj",
        "cube.obj mirrored.yaml -o mirrored.obj",
        "cube.obj folded.yaml -o folded.obj --no-check --mesh-mode vertices",
        "cube.obj fitted.yaml -o fits.obj --no-check --mesh-mode vertices",
    ]
    agree("ffd deform, to a mesh", [report(f"deform {run}") for run in runs])
    agree("ffd deform --dry-run", [report("deform cube.obj bend.yaml --dry-run --profile")])


def test_verify_and_info(report, folder):
    report("deform cube.obj bend.yaml -o judged.step")
    parts.write_part("cylinder", folder)
    report("deform cylinder.step bend.yaml -o bent.step --report made.json")
    agree(
        "ffd verify",
        [
            report("verify judged.step cube.obj bend.yaml"),
            report("verify bent.step cylinder.step bend.yaml --against made.json"),
        ],
    )
    agree("ffd info, a mesh", [report("info cube.obj")])
    agree("ffd info, a CAD file", [report("info judged.step")])


def test_info_of_lattices(report):
    names = ("weighted", "octree", "inverse", "mirrored", "folded", "fitted", "several")
    found = [report(f"info {name}.yaml --mesh cube.obj") for name in names]
    found.append(report("info bend.yaml --mesh cube.obj --injective-scale"))
    agree("ffd info, a lattice", [*found, *found[-2]["lattices"]])


def test_new_and_solve(report):
    agree("ffd new", [report("new cube.obj")])
    solved = [report(f"solve cube.obj {name}.yaml --steps") for name in ("drag", "several")]
    agree("ffd solve", solved)


def test_fit(report, folder):
    rows = [(x, y, z, -1.5 * x * z, 0, 0) for x in (0, 1, 3) for y in (0, 3) for z in (0, 2, 3)]
    lines = ["x,y,z,dx,dy,dz", *(",".join(map(str, row)) for row in rows)]
    (folder / "field.csv").write_text("\n".join(lines))
    how = "fit cube.obj field.csv --volume bspline --degree 1 --points 2 2 2"
    agree("ffd fit", [report(how), report(f"{how} --scale 0.01 -o from-field.yaml")])
    (entry,) = report("fit cube.obj cube.obj -o onto-itself.yaml")["fits"]
    assert {f"scan.{name}" for name in entry["scan"]} == fields("Fits onto scans")


def test_batch(report):
    found = report("batch jobs.yaml --jobs 1", status=3)
    assert [job["status"] for job in found["jobs"]] == ["verified", "rejected", "failed"]
    agree("ffd batch", [found])
    (failed,) = (job["error"] for job in found["jobs"] if job["status"] == "failed")
    assert {f"error.{name}" for name in failed} == fields("Errors")
