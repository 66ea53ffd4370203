"""The table of real meshes: each deformed, written, re-read and verified by the command line.

    python benchmarks/real_meshes.py [--degrees 2,3] [--patches merged] [MESH ...]

Without names, all meshes in ../shared/meshes. Every run is a process of its own, as a user would
have it: its exit status, its message and its two reports are all that is looked at. Rows are
printed as they come and replace those of the same mesh, degree and patches in docs/real-meshes.md.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MESHES = ROOT.parent / "shared" / "meshes"
TABLE = ROOT / "docs" / "real-meshes.md"
HEAD = ("mesh", "degree", "patches", "faces", "valid", "closed", "deviation", "seconds", "verified")
LATTICE = """\
version: 1
degree: [{degree}, {degree}, {degree}]
points: [5, 6, 5]
edits:
  - twist: {{axis: w, angle: 25}}
  - bend: {{axis: v, toward: w, angle: 20}}
  - taper: {{axis: u, factor: 0.8}}
"""
FFD = [sys.executable, "-c", "from ffdcli.cli import main; main()"]
# A run that takes longer counts as hanging.
PATIENCE = 3600


def main() -> None:
    """Run, print, and bring the page up to date."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("meshes", nargs="*", help="names of files in ../shared/meshes")
    parser.add_argument("--degrees", default="2,3")
    parser.add_argument("--patches", default="merged")
    options = parser.parse_args()
    names = options.meshes or sorted(p.name for p in MESHES.iterdir() if p.suffix != ".md")
    wrong = 0
    print(line(HEAD), line(["---"] * len(HEAD)), sep="\n")
    for name in names:
        for degree in options.degrees.split(","):
            for patches in options.patches.split(","):
                row, sound = measure(MESHES / name, int(degree), patches)
                print(line(row), flush=True)
                keep(row)
                wrong += not sound
    sys.exit(
        f"{wrong} runs ended neither in a verified file nor in a named refusal" if wrong else 0
    )


def measure(mesh: Path, degree: int, patches: str) -> tuple[list[str], bool]:
    """The row of one run, and whether it ended as it should."""
    key = [mesh.name, str(degree), patches]
    with tempfile.TemporaryDirectory() as folder:
        lattice, out = Path(folder, "lattice.yaml"), Path(folder, "out.step")
        lattice.write_text(LATTICE.format(degree=degree))
        report = Path(folder, "report.json")
        start = time.perf_counter()
        words = ["deform", mesh, lattice, "-o", out, "--patches", patches, "--report", report]
        done = run([*words, "--json"])
        seconds = f"{time.perf_counter() - start:.1f}"
        if done.returncode:
            found = json.loads(done.stdout or "{}").get("error", {})
            refused = done.returncode == 1 and found.get("kind") not in (None, "internal", "check")
            said = found.get("message") or (done.stderr.strip().splitlines() or ["no message"])[-1]
            what = f"refused: {said}" if refused else f"FAILED: {said}"
            sound = refused and not out.exists() and str(mesh.name) in str(found.get("file"))
            return [*key, *["-"] * 4, seconds, what.replace("|", "/")], sound
        made = json.loads(report.read_text())
        # By what the run states: its bound, and what the mesh's own planes are off.
        done = run(["verify", out, mesh, lattice, "--against", report, "--json"])
        size = json.loads(run(["info", mesh, "--json"]).stdout)["size"]
        judged = json.loads(done.stdout)
        if "error" in judged:
            return [*key, *["-"] * 4, seconds, f"FAILED: {judged['error']['message']}"], False
        says = {True: "yes", False: "NO"}
        closed = judged["watertight"]
        # An open mesh is to give an open shell.
        shape = "yes" if closed else "open shell" if not made["mesh"]["closed"] else "NO"
        sound = judged["passed"] and judged["valid"] and closed == made["mesh"]["closed"]
        deviation = f"{judged['max_deviation'] / size:.1e}"
        verdict = [says[judged["valid"]], shape, deviation, seconds, says[judged["passed"]]]
        return [*key, str(judged["faces"]), *verdict], sound


def run(words: list[object]) -> subprocess.CompletedProcess[str]:
    """One command of ffd."""
    return subprocess.run(
        [*FFD, *map(str, words)], capture_output=True, text=True, timeout=PATIENCE, check=False
    )


def keep(row: list[str]) -> None:
    """Put a row into the page, in place of the one of the same run."""
    lines = TABLE.read_text(encoding="utf-8").splitlines()
    begin = next(i for i, text in enumerate(lines) if text.startswith("| mesh"))
    rows = {tuple(cells(text)[:3]): text for text in lines[begin + 2 :] if text.startswith("|")}
    rows[tuple(row[:3])] = line(row)
    page = [*lines[: begin + 2], *(rows[key] for key in sorted(rows)), ""]
    TABLE.write_text("\n".join(page), encoding="utf-8")


def line(values: object) -> str:
    """A line of the table."""
    return "| " + " | ".join(map(str, values)) + " |"


def cells(text: str) -> list[str]:
    """What :func:`line` made a line of."""
    return re.split(r" *\| *", text.strip())[1:-1]


if __name__ == "__main__":
    main()
