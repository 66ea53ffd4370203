"""Names that steer terminals are printed escaped; file names need not be UTF-8."""

import csv
import json
import os
import re

import pytest

from ffdcli.messages import json_text, printable, printable_lines
from support.commands import ffd
from support.jobs import CUBE, CUBE_FACES, obj

# A colour, a window title, a C1 control sequence, a deletion, and writing from right to left.
STEERING = "\x1b[31m \x1b]0;t\x07 \x9b1m \x7f \u202egpj \u2066"
RAW = re.compile("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
# A byte that begins no character of UTF-8, and a control character.
STEM = os.fsdecode(b"a\xff\x1bb")
LATTICE = "version: 1\ndegree: [2, 2, 2]\npoints: [3, 3, 3]\n"


@pytest.fixture
def named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / f"{STEM}.obj").write_text(f"o {STEERING}\n{obj(CUBE, CUBE_FACES)}")
    (tmp_path / f"{STEM}.yaml").write_text(LATTICE)
    return tmp_path


def require_harmless(result):
    assert not RAW.search(result.stdout)
    assert not RAW.search(result.stderr)
    return result


def test_escapes():
    text = printable(f"{STEERING}\n{os.fsdecode(bytes([0xFF]))}ä€")
    assert text == (r"\x1b[31m \x1b]0;t\x07 \x9b1m \x7f \u202egpj \u2066\x0a\xff" + "ä€")
    assert printable_lines("a\nb\x1b") == "a\nb\\x1b"
    for indent in (None, 2):
        value = {STEERING: [STEM, "ä\n€", 1.5]}
        made = json_text(value, indent)
        assert not RAW.search(made)
        assert json.loads(made) == value


def test_what_a_mesh_holds_is_printed_escaped(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text(f"zz{STEERING}\nmtllib {STEERING}\nusemtl a\n{obj(CUBE, CUBE_FACES)}")
    found = require_harmless(ffd("info", path))
    assert r"zz\x1b[31m" in found.stderr
    assert require_harmless(ffd("info", path, "--json")).stdout
    path.write_text("v \x1b[31m 0 0\nf 1 1 1\n")
    assert r"not a number: \x1b[31m" in require_harmless(ffd("info", path, status=1)).stderr
    for name, text in (("a.ply", f"ply\n{STEERING}\nend_header\n"), ("a.yaml", f"a: '{STEERING}'")):
        (tmp_path / name).write_text(text)
        require_harmless(ffd("info", tmp_path / name, status=1))
    require_harmless(ffd("info", tmp_path / f"{STEERING}.obj", status=1))
    require_harmless(ffd(STEERING, status=2))
    require_harmless(ffd("info", path, f"--{STEERING}", status=2))


def test_commands_take_names_that_are_not_utf8(named):
    mesh, lattice = f"{STEM}.obj", f"{STEM}.yaml"
    for command in (
        ["info", mesh],
        ["info", mesh, "--json"],
        ["info", lattice, "--mesh", mesh],
        ["new", mesh],
        ["new", mesh, "-o", f"{STEM}.new.yaml"],
        ["info", f"{STEM}.new.yaml"],
        ["solve", mesh, lattice, "-o", f"{STEM}.solved.yaml", "--steps"],
        ["info", f"{STEM}.solved.yaml"],
        ["view", mesh, lattice, "-o", f"{STEM}.html"],
        ["view", mesh, lattice, "-o", f"{STEM}.png"],
    ):
        require_harmless(ffd(*command))
    for end in ("step", "iges", "brep"):
        made, report = f"{STEM}.{end}", f"{STEM}.{end}.json"
        found = require_harmless(ffd("deform", mesh, lattice, "-o", made, "--report", report))
        assert r"a\xff\x1bb" in found.stdout
        assert json.loads((named / report).read_text())["output"] == made
        require_harmless(ffd("info", made))
        require_harmless(ffd("verify", made, mesh, lattice, "--against", report))
    require_harmless(ffd("view", f"{STEM}.step", "-o", f"{STEM}.html"))
    for end in ("stl", "obj", "ply", "off", "glb", "3mf"):
        require_harmless(ffd("deform", mesh, lattice, "-o", f"{STEM}.made.{end}"))
        require_harmless(ffd("info", f"{STEM}.made.{end}"))


def test_batches_take_names_that_are_not_utf8(named):
    (named / "jobs.yaml").write_text(
        'version: 1\noutput: "{mesh}.step"\nverify: true\n'
        'jobs: [{mesh: "a*.obj", lattice: "a*.yaml"}]\n'
    )
    first = require_harmless(ffd("batch", "jobs.yaml", "-j", "1"))
    assert first.stdout.startswith("1 job: 1 verified")
    [record] = map(json.loads, (named / "manifest.jsonl").read_text().splitlines())
    assert record["output"] == f"{STEM}.step"
    assert (named / record["output"]).is_file()
    [row] = csv.DictReader((named / "summary.csv").open())
    assert row["output"] == r"a\xff\x1bb.step"
    again = require_harmless(ffd("batch", "jobs.yaml", "-j", "1", "--json"))
    assert json.loads(again.stdout)["kept"] == 1
