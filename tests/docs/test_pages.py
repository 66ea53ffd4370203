"""What the pages of the documentation show: commands and Python run, files are valid."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ffdcli import read_lattice, read_mesh
from support.commands import ffd
from support.doc_pages import ELSEWHERE, PAGES, ROOT, blocks, words

NAMES = [str(page.relative_to(ROOT / "docs")) for page in PAGES]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the samples in it, shared by all pages, and the commands done there."""
    folder = tmp_path_factory.mktemp("pages")
    shutil.copytree(ROOT / "samples", folder / "samples")
    return folder, set()


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_commands_run(page, folder, monkeypatch):
    place, done = folder
    monkeypatch.chdir(place)
    for block in blocks(page):
        if block.file:
            # Commands on it are to be done anew where another page has a file of that name.
            text = Path(block.file).read_text() if Path(block.file).exists() else None
            if text != block.text:
                done -= {command for command in done if block.file in command}
                Path(block.file).write_text(block.text, encoding="utf-8")
        for command in block.commands:
            if not command.startswith("ffd "):
                assert command.startswith(ELSEWHERE), f"{page}: nothing runs `{command}`"
            elif command not in done:
                arguments, status = words(command)
                run = ffd(*arguments, status=None)
                assert run.exit_code == status, f"{page}: {command}\n{run.output}"
                assert run.stdout, command
                if "-o" in arguments:
                    assert Path(arguments[arguments.index("-o") + 1]).stat().st_size, command
                done.add(command)


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_yaml_is_valid(page, tmp_path):
    """Files that commands use are read by these; here are the others."""
    shown = [block for block in blocks(page) if block.language == "yaml"]
    commands = " ".join(command for block in blocks(page) for command in block.commands)
    mesh = read_mesh(ROOT / "samples" / "bracket.obj") if shown else None
    for number, block in enumerate(shown):
        path = tmp_path / f"{number}.yaml"
        if block.file:
            assert block.file in commands, f"{page}: no command uses {block.file}"
        elif "version:" in block.text:
            path.write_text(block.text, encoding="utf-8")
            assert read_lattice(path, mesh).members
        else:
            # A piece of a lattice file; its points may be those of another mesh.
            path.write_text(f"version: 1\n{block.text}", encoding="utf-8")
            read_lattice(path)


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_python_runs(page, folder):
    shown = [block.text for block in blocks(page) if block.language == "python"]
    if shown:
        command = [sys.executable, "-c", "\n".join(shown)]
        run = subprocess.run(command, cwd=folder[0], capture_output=True, text=True)
        assert run.returncode == 0, f"{page}\n{run.stderr}"
        assert run.stdout.startswith(("321 ", "38 "))


def test_sections_that_the_code_cites_exist():
    page = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")
    titles = set(re.findall(r"^## (.*)$", page, flags=re.MULTILINE))
    cited = {
        " ".join(title.split())
        for path in (ROOT / "ffdcli").rglob("*.py")
        for title in re.findall(r'docs/design\.md,\s+"([^"]+)"', path.read_text(encoding="utf-8"))
    }
    assert cited
    assert cited <= titles
