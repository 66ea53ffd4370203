"""The table of kinds of CAD parts: control points, deviation and seconds by fit tolerance.

    python benchmarks/part_kinds.py [NAME ...]

The parts are those of the tests (`tests/support/parts.py`). Each is twisted and bent by a lattice
of degrees 3, 2 and 3, written as STEP, read again and verified. Seconds are of the processor. It
ends with 1 if one fails.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

from ffdcli import deform, read_lattice, read_part
from ffdcli.verify.part.file import verify_part_file

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support import parts

SHARES = (1e-4, 1e-5, 1e-7)
LATTICE = """\
version: 1
degree: [3, 2, 3]
points: [5, 4, 6]
edits:
  - twist: {axis: w, angle: 30}
  - bend: {axis: u, toward: w, angle: 25}
"""


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="parts; all by default")
    names = parser.parse_args().names or list(parts.PARTS)
    heads = [f"within {share:.0e}" for share in SHARES]
    print(line(["part", "faces", *heads]), line(["---"] * (2 + len(heads))), sep="\n")
    failed = []
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            path = parts.write_part(name, Path(folder))
            faces = read_part(path).face_count
            cells = [measure(path, share) for share in SHARES]
        print(line([name, str(faces), *cells]), flush=True)
        failed += [name for cell in cells if cell == "FAILED"]
    sys.exit(f"failed: {', '.join(failed)}" if failed else 0)


def measure(path: Path, share: float) -> str:
    """Control points, deviation as a share of the size, processor seconds of fit and file."""
    lattice, out = path.with_suffix(".yaml"), path.with_name("out.step")
    lattice.write_text(LATTICE)
    part = read_part(path)
    settled = read_lattice(lattice, part)
    start = time.process_time()
    result = deform(part, settled, fit_tolerance=share * part.size).write(out)
    spent = time.process_time() - start
    # Coordinates are written with an error of some 1e-16 of the size.
    allowed = max(result.max_error, 1e-12 * part.size)
    verdict = verify_part_file(out, part, settled, tolerance=allowed)
    if not verdict.passed:
        return "FAILED" if verdict.reasons else "undecided"
    off = verdict.max_deviation / part.size
    return f"{result.report['control_points']:,}; {off:.1e}; {spent:.1f} s"


def line(values: list[str]) -> str:
    """A line of the table."""
    return "| " + " | ".join(values) + " |"


if __name__ == "__main__":
    main()
