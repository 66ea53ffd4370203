"""What the README shows: its commands and its Python run, its lattice file is valid."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ffdcli import read_lattice, read_mesh
from ffdcli.batch import list_jobs
from ffdcli.batch.spec import BatchSpec, DeformOptions, Entry
from ffdcli.cli.main import main
from ffdcli.lattice.file.edit_models import EDITS
from ffdcli.lattice.file.spec import LatticeSpec
from support.places import ROOT

TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
BIN = Path(sys.executable).parent


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```$", TEXT, flags=re.MULTILINE | re.DOTALL)


def ffd_commands():
    """Each `ffd` command of the shell blocks, once, in order; also what follows an `&&`."""
    lines = [part.strip() for block in blocks("sh") for part in re.split(r"\n|&&", block)]
    return list(dict.fromkeys(line for line in lines if line.startswith("ffd ")))


@pytest.fixture
def folder(tmp_path):
    """A folder with the samples in it, as the README expects."""
    shutil.copytree(ROOT / "samples", tmp_path / "samples")
    (tmp_path / "jobs.yaml").write_text(blocks("yaml")[-1], encoding="utf-8")
    return tmp_path


def test_commands_run(folder):
    commands = ffd_commands()
    assert len(commands) >= 8
    for command in commands:
        words = shlex.split(command)
        words[0] = shutil.which("ffd", path=str(BIN))
        run = subprocess.run(words, cwd=folder, capture_output=True, text=True)
        assert run.returncode == 0, f"{command}\n{run.stderr}"
        assert run.stdout, command
        if "-o" in words:
            assert (folder / words[words.index("-o") + 1]).stat().st_size, command


def test_python_runs(folder):
    (code,) = blocks("python")
    run = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("321 ")
    assert (folder / "bracket-0.25.step").exists()


def test_lattice_files_are_valid(tmp_path):
    mesh = read_mesh(ROOT / "samples" / "bracket.obj")
    *lattices, _ = blocks("yaml")
    for number, text in enumerate(lattices):
        path = tmp_path / f"{number}.yaml"
        path.write_text(text, encoding="utf-8")
        assert all(volume.net.size for volume in read_lattice(path, mesh).maps)
    short, sample = (read_lattice(p, mesh) for p in (tmp_path / "0.yaml", _sample("bracket.yaml")))
    assert (short.volume.net == sample.volume.net).all()
    tour = lattices[1]
    for key in LatticeSpec.model_fields:
        assert re.search(rf"^{key}:", tour, flags=re.MULTILINE), key
    for edit in EDITS:
        assert any(f"- {edit}:" in text for text in lattices) or f"`{edit}`" in TEXT, edit


def test_jobs_file_shows_every_key(folder):
    text = blocks("yaml")[-1]
    jobs = list_jobs(folder / "jobs.yaml")
    assert [job.output for job in jobs] == ["out/bracket-0.5.step", "out/bracket-1.step"]
    for key in (*BatchSpec.model_fields, *Entry.model_fields):
        assert re.search(rf"^[ -]*{key}:", text, flags=re.MULTILINE), key
    for option in (f.alias or name for name, f in DeformOptions.model_fields.items()):
        assert re.search(rf"options:[^\n]*\b{option}\b", text), option


def test_every_command_is_described():
    for command in main.list_commands(None):
        assert f"| `ffd {command}" in TEXT, command


def test_files_that_are_named_exist():
    for target in re.findall(r"\]\(([^)#:]+)\)", TEXT):
        assert (ROOT / target).is_file(), target
    for name in re.findall(r"`((?:ffdcli|samples|docs|\.ci)/[^`]*)`", TEXT):
        assert (ROOT / name).exists(), name


def _sample(name):
    return ROOT / "samples" / name
