"""The script of the corpus: a table of what became of every file, and nothing is run twice."""

import os
import re
import subprocess
import sys

import pytest

from support.parts import write_part
from support.places import BENCHMARKS
from support.plain_files import CUBE

TRIANGLE = """\
facet normal 0 0 1
outer loop
vertex {} {} 0
vertex {} {} 1
vertex {} {} 0
endloop
endfacet
"""
HEAD = (
    "|  | degree | run | made and verified | made with `--repair` | refused | wrong | undecided | "
)


@pytest.fixture
def folder(tmp_path):
    """Good, open, inside out, cut short, doubled, large, and no mesh; names of every kind."""
    folder = tmp_path / "files"
    (folder / "a [1] b").mkdir(parents=True)
    (folder / "a [1] b" / "good.obj").write_text(CUBE)
    inside_out = re.sub(r"f (.*)", lambda found: "f " + " ".join(found[1].split()[::-1]), CUBE)
    (folder / "inside.obj").write_text(inside_out)
    with open(os.fsencode(folder) + b"/cut\xff.off", "w") as stream:
        stream.write("OFF\n3 1 0\n")
    opened = f"solid\n{TRIANGLE.format(0, 0, 1, 0, 0, 1)}endsolid\n"
    for name in ("open.stl", "same.stl"):
        (folder / name).write_text(opened)
    rows = [TRIANGLE.format(x, 0, x + 1, 0, x, 1) for x in range(40)]
    (folder / "large.stl").write_text(f"solid\n{''.join(rows)}endsolid\n")
    (folder / "part.step").write_text("ISO-10303-21;\n")
    write_part("cylinder", folder)
    os.mkfifo(folder / "pipe.obj")
    return folder


def corpus(folder, *words):
    done = subprocess.run(
        [sys.executable, BENCHMARKS / "corpus.py", folder, "--degrees", "2", "--largest", "30"]
        + ["--work", folder.parent / "run", "-j", "1", *words],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines(), done.stderr


def test_every_file_is_accounted_for(folder):
    lines, _ = corpus(folder)
    assert lines[0] == (
        "Mesh files: 4, CAD files: 2. Not run: equal to another byte by byte: 1, "
        "of more than 30 facets: 1."
    )
    (head,) = (i for i, text in enumerate(lines) if text.startswith(HEAD))
    assert lines[head + 2 : head + 4] == [
        "| meshes | 2 | 4 | 2 | 1 | 1 | 0 | 0 | 0 | 0 | 0 |",
        "| CAD parts | 2 | 2 | 1 | 0 | 1 | 0 | 0 | 0 | 0 | 0 |",
    ]
    (cause,) = (text for text in lines if "promises" in text)
    assert cause.split(" | ")[1:] == ["1", r"files/cut\xff.off |"]
    (part,) = (text for text in lines if text.startswith("| files/cylinder.step"))
    kinds = "| files/cylinder.step | 2 | 1 cylinder, 2 plane | yes | yes | 2 | 1 | "
    assert part.startswith(kinds)
    run = folder.parent / "run"
    assert not list(run.glob("*.step"))
    assert (run / "table.md").read_text().splitlines() == lines

    again, said = corpus(folder)
    assert again == lines
    assert re.findall(r"\d+ jobs to do", said) == ["0 jobs to do"] * 2
    assert re.findall(r"\d+ jobs to do", corpus(folder, "--again")[1]) == [
        "3 jobs to do",
        "0 jobs to do",
    ]
