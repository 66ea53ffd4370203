"""The benchmarks run, on toys; no time is judged."""

import ast
import importlib
import os
import subprocess
import sys

import pytest

from support.places import BENCHMARKS


@pytest.fixture(scope="module")
def printed():
    done = subprocess.run(
        [sys.executable, BENCHMARKS / "run.py", "--size", "small"],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONWARNINGS": "ignore"},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_every_row_is_printed(printed):
    lines = [line for line in printed.splitlines() if line.startswith("|")][2:]
    assert all(line.count("|") == 6 for line in lines)
    for words in (
        "`ffd deform`, sphere of 180 facets, exact, --no-check",
        "with checks",
        "finished OpenCascade shape",
        "kept plan",
        "500 facets: our own stages",
        "box 100×60×40",
        "CAD's poles moved",
        "of a CAD part of",
        "the small part's poles moved",
        "500 facets, --tolerance 1e-6 × size",
        "Fig. 13",
        "`ffd edit`: preview of a drag",
        "`ffd batch`",
    ):
        assert any(words in line for line in lines), words


def test_the_papers_cube_is_cut_as_the_paper_says(printed):
    (line,) = [line for line in printed.splitlines() if "Fig. 7:" in line]
    assert "; the paper's 36 / 24 / 216 / " in line


@pytest.mark.parametrize("script", sorted(BENCHMARKS.rglob("*.py")), ids=lambda path: path.stem)
def test_scripts_import_what_the_package_has(script):
    for node in ast.walk(ast.parse(script.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("ffdcli"):
            module = importlib.import_module(node.module)
            assert all(hasattr(module, each.name) for each in node.names), node.module
