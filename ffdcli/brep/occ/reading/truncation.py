"""Files that are cut short, told before OpenCascade reads them: some end it, some it never ends."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path


def is_whole_iges(path: Path) -> bool:
    """Tell whether the last line counts the lines of each section right.

    OpenCascade does not look, and reading a file that is cut short can end the process.
    """
    lines = [line for line in path.read_bytes().splitlines() if line.strip()]
    found = Counter(line[72:73] for line in lines)
    # Columns 1 to 32 of the last line: S, G, D and P, each with seven digits.
    last = lines[-1] if lines else b""
    counts = {last[at : at + 1]: last[at + 1 : at + 8].strip() for at in range(0, 32, 8)}
    sections = {key: b"%d" % found[key] for key in (b"S", b"G", b"D", b"P")}
    return last[72:73] == b"T" and counts == sections


def is_whole_brep(path: Path) -> bool:
    """Tell whether a file has all the shapes it says it has, and says which is the whole.

    Of other files OpenCascade complains on stdout, or reads on for ever.
    """
    head, mark, topology = path.read_bytes().rpartition(b"\nTShapes ")
    lines = [line.strip() for line in topology.splitlines() if line.strip()]
    if not mark or b"CASCADE Topology V" not in head[:200] or not lines:
        return False
    # The list of parts that ends every shape ends with an asterisk.
    shapes = sum(line.endswith(b"*") for line in lines)
    return lines[0] == b"%d" % shapes and re.fullmatch(rb"[+-]\d+ \d+", lines[-1]) is not None
