"""Small meshes, lattices and jobs files, and ways to run `ffd batch` on them."""

import json
import os
import subprocess
from pathlib import Path

from support.commands import COMMAND
from support.plain_files import CUBE

OPEN = CUBE.rsplit("\n", 2)[0] + "\n"
LATTICE = """\
version: 1
degree: [2, 2, 2]
points: [3, 3, 3]
edits:
  - move: {at: [2, 2, 2], by: [0, 0, ${height}]}
  - twist: {axis: w, angle: 30}
"""
PLAIN = LATTICE.replace("${height}", "1")
HERE = Path(__file__).parent


def fill_folder(folder):
    """The files that the tests' jobs name."""
    for name, text in {
        "cube.obj": CUBE,
        "slab.obj": CUBE.replace(" 4\n", " 1\n", 4),
        "open.obj": OPEN,
        "segv.obj": CUBE,
        "kill.obj": CUBE,
        "hang.obj": CUBE,
        "lattice.yaml": LATTICE,
        "plain.yaml": PLAIN,
        "bad.yaml": PLAIN.replace("angle: 30", "angel: 30"),
    }.items():
        (folder / name).write_text(text)
    return folder


def command(*arguments):
    return [*COMMAND, "batch", *map(str, arguments)]


def environment(*, crashing=False, **more):
    found = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", **more}
    if crashing:
        found["PYTHONPATH"] = os.pathsep.join(
            [str(HERE / "crashing"), *filter(None, [os.environ.get("PYTHONPATH")])]
        )
    return found


def run(folder, *arguments, status=0, **settings):
    """Run `ffd batch --json` in a folder; its facts."""
    done = subprocess.run(
        command(*arguments, "--json"),
        cwd=folder,
        env=environment(**settings),
        capture_output=True,
        text=True,
    )
    assert done.returncode == status, done.stderr
    return json.loads(done.stdout)


def lines(manifest):
    """Records of a manifest; a line that a killed batch left unfinished is left out."""
    records = []
    for line in manifest.read_text().splitlines():
        try:
            records.append(json.loads(line))
        except ValueError:
            continue
    return records
