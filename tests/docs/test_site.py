"""The site builds with warnings as errors, and its links resolve."""

import importlib.util
import subprocess
import sys

import pytest

from ffdcli.cli.main import main
from support.doc_pages import ROOT

MISSING = [name for name in ("sphinx", "myst_parser", "furo") if not importlib.util.find_spec(name)]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    if MISSING:
        pytest.skip(f"the docs extra is not installed: {', '.join(MISSING)}")
    place = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-n", "-q"]
    command += ["-d", str(place / "trees"), str(ROOT / "docs"), str(place / "html")]
    run = subprocess.run(command, cwd=place, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return place / "html"


def test_no_link_is_broken(site):
    command = [sys.executable, str(ROOT / "docs" / "check_links.py"), str(site)]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout


def test_references_are_filled_from_the_code(site):
    text = {
        name: (site / "reference" / f"{name}.html").read_text(encoding="utf-8")
        for name in ("commands", "lattice-file", "jobs-file", "python", "receivers")
    }
    for command in main.list_commands(None):
        assert f"ffd {command}" in text["commands"], command
    assert "--require-injective" in text["commands"]
    assert "level_cost" in text["lattice-file"]
    assert "iges_mode" in text["jobs-file"]
    assert "with_matrices" in text["python"]
    assert "rhino" in text["receivers"]
