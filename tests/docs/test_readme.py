"""What the README shows: its commands and its Python run, its lattice file is valid."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import ffdcli
from ffdcli import read_lattice, read_mesh
from ffdcli.batch.spec import BatchSpec, DeformOptions, Entry
from ffdcli.cli.main import main
from ffdcli.lattice.file.edit_models import EDITS
from ffdcli.lattice.file.spec import LatticeSpec
from support.commands import ffd
from support.doc_pages import ELSEWHERE, PAGES, ROOT, blocks, words

README = ROOT / "README.md"
TEXT = README.read_text(encoding="utf-8")
DOCS = ROOT / "docs"
BIN = Path(sys.executable).parent


def shown(language, page=README):
    return [block for block in blocks(page) if block.language == language]


@pytest.fixture
def folder(tmp_path):
    """A folder with the samples in it, as the README expects."""
    shutil.copytree(ROOT / "samples", tmp_path / "samples")
    return tmp_path


def test_is_one_page():
    assert len(TEXT.splitlines()) <= 200


def test_types_are_shipped():
    assert (Path(ffdcli.__file__).parent / "py.typed").is_file()


def test_commands_run(folder):
    """As a user runs them, in processes; the pages' commands run in this one."""
    commands = dict.fromkeys(line for block in blocks(README) for line in block.commands)
    run = [command for command in commands if command.startswith("ffd ")]
    assert len(run) >= 5
    assert all(line in run or line.startswith(ELSEWHERE) for line in commands)
    for command in run:
        arguments, status = words(command)
        program = shutil.which("ffd", path=str(BIN))
        done = subprocess.run([program, *arguments], cwd=folder, capture_output=True, text=True)
        assert done.returncode == status, f"{command}\n{done.stderr}"
        assert done.stdout, command
        if "-o" in arguments:
            assert (folder / arguments[arguments.index("-o") + 1]).stat().st_size, command


def test_python_runs(folder):
    (code,) = shown("python")
    command = [sys.executable, "-c", code.text]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("321 ")


def test_lattice_file_is_the_sample(tmp_path):
    mesh = read_mesh(ROOT / "samples" / "bracket.obj")
    (block,) = shown("yaml")
    (tmp_path / "short.yaml").write_text(block.text, encoding="utf-8")
    files = (tmp_path / "short.yaml", ROOT / "samples" / "bracket.yaml")
    short, sample = (read_lattice(file, mesh) for file in files)
    assert (short.maps[0].net == sample.maps[0].net).all()


def test_pages_show_every_key():
    page = DOCS / "reference" / "lattice-file.md"
    (tour,) = [block.text for block in shown("yaml", page)]
    for key in LatticeSpec.model_fields:
        assert re.search(rf"^{key}:", tour, flags=re.MULTILINE), key
    every = [block.text for page in PAGES for block in shown("yaml", page)]
    words_of_pages = " ".join(page.read_text(encoding="utf-8") for page in PAGES)
    for edit in EDITS:
        assert any(f"- {edit}:" in text for text in every) or f"`{edit}`" in words_of_pages, edit
    (jobs,) = [block.text for block in shown("yaml", DOCS / "howto" / "batches.md")]
    for key in (*BatchSpec.model_fields, *Entry.model_fields):
        assert re.search(rf"^[ -]*{key}:", jobs, flags=re.MULTILINE), key
    for option in (f.alias or name for name, f in DeformOptions.model_fields.items()):
        assert re.search(rf"options:[^\n]*\b{option}\b", jobs), option


def test_every_command_is_described():
    for command in main.list_commands(None):
        assert f"| `ffd {command}" in TEXT, command
        ffd(command, "--help")


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"])
def test_files_that_are_named_exist(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (ROOT / target).is_file(), target
    for name in re.findall(r"`((?:ffdcli|samples|docs|tests|benchmarks|\.ci)/[^`{}*]*)`", text):
        assert name.startswith("docs/_build") or (ROOT / name).exists(), name
