"""Detect truncated files, which crash OpenCascade or make it hang."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path


def is_complete_iges(path: Path) -> bool:
    """True if the last line of an IGES file states the line count of each section correctly.

    OpenCascade does not check it, and may crash on a truncated file.
    """
    lines = [line for line in path.read_bytes().splitlines() if line.strip()]
    found = Counter(line[72:73] for line in lines)
    # Columns 1 to 32 of the last line: S, G, D and P, each with seven digits.
    last = lines[-1] if lines else b""
    counts = {last[at : at + 1]: last[at + 1 : at + 8].strip() for at in range(0, 32, 8)}
    sections = {key: b"%d" % found[key] for key in (b"S", b"G", b"D", b"P")}
    return last[72:73] == b"T" and counts == sections


def is_complete_brep(path: Path) -> bool:
    """True if a .brep file contains all the shapes that it announces, and names its root.

    On other files OpenCascade prints errors to stdout, or never returns.
    """
    head, mark, topology = path.read_bytes().rpartition(b"\nTShapes ")
    lines = [line.strip() for line in topology.splitlines() if line.strip()]
    if not mark or b"CASCADE Topology V" not in head[:200] or not lines:
        return False
    # The list of parts that ends every shape ends with an asterisk.
    shapes = sum(line.endswith(b"*") for line in lines)
    return lines[0] == b"%d" % shapes and re.fullmatch(rb"[+-]\d+ \d+", lines[-1]) is not None
