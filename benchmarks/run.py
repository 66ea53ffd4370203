"""Print the table of benchmarks: `python benchmarks/run.py [--size small|full] [--only ROW]`.

Ratios are of times measured in one run, medians of several; see the README beside this file.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import tempfile
from pathlib import Path

# Before numpy loads: peers have one thread too.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[name] = "1"

from measure import table  # noqa: E402
from rows import ROWS, SIZES  # noqa: E402


def main() -> None:
    """Measure the rows asked for and print them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", choices=list(SIZES), default="full")
    parser.add_argument("--only", action="append", choices=list(ROWS), help="only these rows")
    options = parser.parse_args()
    size, rows = SIZES[options.size], []
    with tempfile.TemporaryDirectory() as folder:
        for row in options.only or ROWS:
            print(f"{row} ...", file=sys.stderr, flush=True)
            try:
                rows += ROWS[row](size, Path(folder))
            except ModuleNotFoundError as error:
                print(f"{row}: left out, there is no {error.name}", file=sys.stderr)
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}\n")
    print(table(rows))


if __name__ == "__main__":
    main()
