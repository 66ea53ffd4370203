"""The table of CAD parts: each deformed, written, read again and verified by the command line.

    python benchmarks/real_parts.py FILE ... [--share 1e-5]

Every run is a process of its own. It ends with 1 if a run ended neither in a verified file nor in a
named refusal.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from measure import FFD

from ffdcli import read_part
from ffdcli.errors import FfdError

HEAD = ("part", "faces by kind", "valid before", "after", "control points", "deviation", "seconds")
LATTICE = """\
version: 1
degree: [3, 3, 3]
points: [5, 6, 5]
edits:
  - twist: {axis: w, angle: 25}
  - bend: {axis: v, toward: w, angle: 20}
  - taper: {axis: u, factor: 0.8}
"""


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("parts", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--share", type=float, default=1e-5, help="fit tolerance / size")
    options = parser.parse_args()
    wrong = 0
    print(line([*HEAD, "verified"]), line(["---"] * (len(HEAD) + 1)), sep="\n")
    for path in options.parts:
        row, sound = measure(path.resolve(), options.share)
        print(line(row), flush=True)
        wrong += not sound
    sys.exit(f"{wrong} runs were wrong" if wrong else 0)


def measure(path: Path, share: float) -> tuple[list[str], bool]:
    """The row of one part, and whether the run ended as it should."""
    try:
        part = read_part(path)
    except FfdError as error:
        return [path.name, *["-"] * 6, f"refused: {error.message}"], True
    before = f"{yes(part.valid)}{'' if part.shell_closed.all() else ', open'}"
    with tempfile.TemporaryDirectory() as folder:
        lattice, out, report = (Path(folder, n) for n in ("l.yaml", "out.step", "report.json"))
        lattice.write_text(LATTICE)
        words = [path, lattice, "-o", out, "--fit-tolerance", repr(share * part.size)]
        done = run(["deform", *words, "--report", report, "--json"])
        made = json.loads(done.stdout or "{}")
        if done.returncode:
            found = made.get("error", {})
            refused = done.returncode == 1 and found.get("kind") not in (None, "internal")
            said = found.get("message") or (done.stderr.strip().splitlines() or ["no message"])[-1]
            row = [
                path.name,
                "-",
                before,
                *["-"] * 4,
                f"{'refused' if refused else 'WRONG'}: {said}",
            ]
            return row, refused and not out.exists()
        words = [out, path, lattice, "--against", report, "--json"]
        judged: dict[str, Any] = json.loads(run(["verify", *words]).stdout)
        if "error" in judged:
            return [
                path.name,
                "-",
                before,
                *["-"] * 4,
                f"WRONG: {judged['error']['message']}",
            ], False
        kinds = made.get("part", {}).get("faces") or {"plane": made["faces"]}
        after = f"{yes(judged['valid'])}{'' if judged['watertight'] else ', open'}"
        passed = judged["passed"]
        row = [
            path.name,
            ", ".join(f"{count} {kind}" for kind, count in kinds.items()),
            before,
            after,
            f"{made['control_points']:,}",
            f"{judged['max_deviation'] / part.size:.1e}",
            f"{sum(made['seconds'].values()):.1f}",
            "yes" if passed else "NO: " + "; ".join(judged["reasons"] or ["undecided"]),
        ]
        return row, passed and (before == after or not part.valid)


def yes(answer: bool) -> str:
    """Yes or NO."""
    return "yes" if answer else "NO"


def run(words: list[object]) -> subprocess.CompletedProcess[str]:
    """One command of ffd."""
    return subprocess.run(
        [sys.executable, *FFD, *map(str, words)], capture_output=True, text=True, check=False
    )


def line(values: list[str]) -> str:
    """A line of the table."""
    return "| " + " | ".join(value.replace("|", "/") for value in values) + " |"


if __name__ == "__main__":
    main()
