"""Estimates of `--dry-run`: counts, bytes and seconds, against a real run."""

import time

import pytest

from ffdcli import prepare, read_lattice, read_mesh
from ffdcli.estimate import estimate
from ffdcli.forecast.rates import Work
from support.places import SAMPLES

KINDS = {"STEP": ".step", "STEP directly": ".step", "IGES": ".igs", "BREP": ".brep"}
# What the estimates promise: bytes within a third, seconds within a factor of three.
BYTES, SECONDS = 4 / 3, 3.0


def planned(name, folder, patches="merged"):
    if name == "rational":
        (folder / "rational.yaml").write_text(
            "version: 1\nvolume: nurbs\npoints: [5, 4, 4]\n"
            "edits:\n- bend: {axis: w, toward: u, angle: 40}\n- weight: {at: [2, 2, 2], value: 2}\n"
        )
        mesh = read_mesh(SAMPLES / "bottle.obj")
        lattice = read_lattice(folder / "rational.yaml", mesh)
    else:
        (source,) = [path for path in SAMPLES.glob(f"{name}.*") if path.suffix != ".yaml"]
        mesh = read_mesh(source)
        lattice = read_lattice(SAMPLES / f"{name}.yaml", mesh)
    return prepare(mesh, lattice, patches=patches), lattice


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("name", "patches"),
    [
        ("bracket", "merged"),
        ("bottle", "merged"),
        ("bottle", "bezier"),
        ("handle", "merged"),
        ("rational", "merged"),
    ],
)
def test_counts_are_the_reports_and_bytes_are_near(name, patches, kind, tmp_path):
    plan, lattice = planned(name, tmp_path, patches)
    told = estimate(plan, lattice, Work(kind.split()[0], "direct" if " " in kind else "kernel"))
    how = {"writer": "direct"} if " " in kind else {}
    report = plan.deform(lattice, check=False).write(tmp_path / f"a{KINDS[kind]}", **how).report
    for count in ("faces", "patches", "edges", "control_points"):
        assert getattr(told, count) == report[count], count
    assert report["bytes"] / BYTES < told.bytes < report["bytes"] * BYTES


def test_a_check_takes_longer(tmp_path):
    plan, lattice = planned("bottle", tmp_path)
    without, checked = (estimate(plan, lattice, Work("STEP", checked=each)) for each in (0, 1))
    assert 2.0 < without.seconds < checked.seconds


@pytest.mark.benchmark
def test_seconds_are_near(tmp_path):
    plan, lattice = planned("bottle", tmp_path)
    checked = estimate(plan, lattice, Work("STEP"))
    plan.deform(lattice).write(tmp_path / "warm.step")
    # Processor time: what other load on the machine hardly changes.
    start = time.process_time()
    plan.deform(lattice).write(tmp_path / "a.step")
    taken = time.process_time() - start
    without_start = checked.seconds - 2.0
    assert taken / SECONDS < without_start < taken * SECONDS
