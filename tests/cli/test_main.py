"""The commands new, schema, solve, info, and what holds for all: errors, status, start-up time."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner

from ffdcli.cli.main import main
from support.commands import ffd
from support.plain_files import CUBE

LATTICE = """\
version: 1
unit: cm
edits:
  - twist: {axis: w, angle: 30}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "cube.obj").write_text(CUBE)
    (tmp_path / "lattice.yaml").write_text(LATTICE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_new_writes_a_starter_that_info_reads(folder):
    assert ffd("new", "cube.obj", "-o", "new.yaml").stdout == "wrote new.yaml\n"
    facts = json.loads(ffd("info", "new.yaml", "--mesh", "cube.obj", "--json").stdout)
    assert facts["kind"] == "lattice"
    assert facts["box"] == {"min": [0, 0, 0], "max": [2, 3, 4]}
    assert facts["moved_points"] == 0
    assert ffd("new", "cube.obj").stdout == (folder / "new.yaml").read_text().replace(
        "new.yaml", "lattice.yaml"
    )


def test_new_overwrites_only_by_force(folder):
    before = (folder / "lattice.yaml").read_text()
    result = ffd("new", "cube.obj", "-o", "lattice.yaml", status=1)
    assert result.stderr.startswith("error: lattice.yaml: this file exists already")
    assert (folder / "lattice.yaml").read_text() == before
    ffd("new", "cube.obj", "-o", "lattice.yaml", "--force")
    assert (folder / "lattice.yaml").read_text() != before


def test_schema_is_json(folder):
    assert ffd("schema").stdout == ffd("schema", "--json").stdout
    assert json.loads(ffd("schema").stdout)["title"] == "ffd lattice file"


def test_solve_gives_a_file_that_solves_to_itself(folder):
    ffd("solve", "cube.obj", "lattice.yaml", "-o", "solved.yaml")
    again = ffd("solve", "cube.obj", "solved.yaml").stdout
    first = (folder / "solved.yaml").read_text()
    assert again.splitlines()[1:] == first.splitlines()[1:]
    assert "unit: cm" in first
    result = json.loads(ffd("solve", "cube.obj", "lattice.yaml", "--json").stdout)
    assert result["output"] is None
    assert result["text"] == first


def test_info_on_a_mesh(folder):
    facts = json.loads(ffd("info", "cube.obj", "--json").stdout)
    assert (facts["kind"], facts["vertices"], facts["polygons"]) == ("mesh", 8, 6)
    assert facts["closed"] is True
    assert facts["volume"] == pytest.approx(24)
    assert facts["size"] == pytest.approx(np.sqrt(29))
    text = ffd("info", "cube.obj").stdout
    assert "closed:               yes\n" in text
    assert "usable:               yes\n" in text


def test_info_on_a_lattice(folder):
    facts = json.loads(ffd("info", "lattice.yaml", "--json").stdout)
    assert (facts["box"], facts["points"], facts["edits"]) == ("auto", [6, 6, 6], ["twist"])
    assert "crossed_sides" not in facts
    (folder / "small.yaml").write_text(LATTICE + "box: {min: [-1, -1, 2], max: [3, 4, 5]}\n")
    result = ffd("info", "small.yaml", "--mesh", "cube.obj")
    assert "crossed sides:    w_min\n" in result.stdout
    assert result.stderr.startswith("warning: edits[0].twist leaves")
    assert ffd("info", "small.yaml", "--mesh", "cube.obj", "--quiet").stderr == ""


def test_info_on_a_step_file(folder):
    import cadquery

    cadquery.exporters.export(cadquery.Workplane().box(1, 2, 3), "box.step")
    facts = json.loads(ffd("info", "box.step", "--json").stdout)
    assert (facts["kind"], facts["solids"], facts["faces"]) == ("cad", 1, 6)
    assert (facts["edges"], facts["vertices"], facts["unit"]) == (12, 8, "mm")
    assert facts["degrees"] == {"plane": 6}
    np.testing.assert_allclose([facts["min"], facts["max"]], [[-0.5, -1, -1.5], [0.5, 1, 1.5]])
    assert "degrees:" in ffd("info", "box.step").stdout


def test_mesh_option_goes_with_lattices(folder):
    assert "--mesh" in ffd("info", "cube.obj", "--mesh", "cube.obj", status=2).stderr


@pytest.mark.parametrize(
    "args",
    [
        ("info", "none.obj"),
        ("info", "none.yaml"),
        ("info", "none.step"),
        ("new", "none.obj", "-o", "new.yaml"),
        ("solve", "cube.obj", "none.yaml", "-o", "new.yaml"),
        ("solve", "cube.obj", "lattice.yaml", "-o", "none/new.yaml"),
        ("new", "cube.obj", "-o", "none/new.yaml"),
        ("new", "cube.obj", "-o", "."),
    ],
)
def test_wrong_files_end_in_one_message_and_status_1(folder, args):
    before = sorted(folder.iterdir())
    result = ffd(*args, status=1)
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
    assert sorted(folder.iterdir()) == before
    told = json.loads(ffd(*args, "--json", status=1).stdout)["error"]
    assert set(told) == {"kind", "message", "file", "line", "key", "hint"}
    assert told["kind"] == "file"
    assert told["file"] in args


def test_lattice_errors_name_line_and_key(folder):
    (folder / "bad.yaml").write_text(LATTICE + "  - move: {at: [0, 0, 9], by: [0, 0, 1]}\n")
    result = ffd("solve", "cube.obj", "bad.yaml", "-o", "out.yaml", "--json", status=1)
    assert result.stderr.startswith("error: bad.yaml:5: edits[1].move.at[2]: index 9 is out of")
    told = json.loads(result.stdout)["error"]
    assert (told["kind"], told["line"], told["key"]) == ("lattice", 5, "edits[1].move.at[2]")
    assert not (folder / "out.yaml").exists()


@pytest.mark.parametrize(
    "args", [("nothing",), ("info",), ("info", "a", "b"), ("new", "cube.obj", "--wrong"), ("--no",)]
)
def test_wrong_usage_is_status_2(folder, args):
    result = ffd(*args, status=2)
    assert result.stdout == ""
    assert "Usage:" in result.stderr
    told = json.loads(ffd(*args, "--json", status=2).stdout)["error"]
    assert told["kind"] == "usage"


def test_an_unexpected_error_is_no_traceback(folder, monkeypatch):
    def fail(*_args, **_kwargs):
        raise ZeroDivisionError("by\nzero")

    monkeypatch.setattr("ffdcli.lattice.file.spec.json_schema", fail)
    result = ffd("schema", "--json", status=1)
    assert "Traceback" not in result.stderr
    assert "ZeroDivisionError: by zero" in result.stderr
    assert json.loads(result.stdout)["error"]["kind"] == "internal"


def test_interruption_is_status_130(folder, monkeypatch):
    def interrupt(*_args, **_kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr("ffdcli.lattice.file.spec.json_schema", interrupt)
    result = ffd("schema", "--json", status=130)
    assert result.stderr.strip() == "interrupted"
    assert json.loads(result.stdout)["error"]["kind"] == "interrupted"


def test_full_disk_and_closed_pipe_are_no_traceback(folder):
    code = "from ffdcli.cli import main; main(['schema'])"
    with open("/dev/full", "w") as full:
        ended = subprocess.run(
            [sys.executable, "-c", code], stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert ended.returncode == 1
    assert ended.stderr.startswith("error: no space left")
    reader, writer = os.pipe()
    os.close(reader)
    ended = subprocess.run([sys.executable, "-c", code], stdout=writer, stderr=subprocess.PIPE)
    os.close(writer)
    assert b"Traceback" not in ended.stderr


@pytest.mark.parametrize("args", [["--help"], ["--version"], ["nothing"], ["deform"], []])
def test_help_and_usage_errors_load_little(args):
    code = (
        "import sys, atexit, click\n"
        "few = 3 * len(sys.modules)\n"
        "heavy = {'numpy', 'scipy', 'trimesh', 'OCP', 'pydantic', 'yaml', 'rich'}\n"
        "def show(): print(len(sys.modules) < few, *(heavy & set(sys.modules)), file=sys.stderr)\n"
        "atexit.register(show)\n"
        f"from ffdcli.cli import main; main({args!r})"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ended.returncode == (0 if args and args[0].startswith("--") else 2)
    assert ended.stderr.splitlines()[-1] == "True"


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "0", "-1", "1e999", "much"])
@pytest.mark.parametrize(
    ("command", "option"),
    [
        ("deform", "--tolerance"),
        ("deform", "--fit-tolerance"),
        ("deform", "--mesh-tolerance"),
        ("deform", "--coplanar-distance"),
        ("deform", "--coplanar-angle"),
        ("verify", "--tolerance"),
        ("info", "--fit-tolerance"),
        ("view", "--fit-tolerance"),
        ("view", "--mesh-tolerance"),
    ],
)
def test_lengths_and_angles_that_are_none_are_wrong_usage(command, option, value):
    done = CliRunner().invoke(main, [command, "a.obj", "b.yaml", "c.obj", option, value])
    assert done.exit_code == 2
    assert option in done.stderr
