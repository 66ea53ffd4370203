"""Memory that can be had: of the machine, of the container, or what FFD_MEMORY allows."""

from __future__ import annotations

import math
import os
import re
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from ffdcli.errors import FfdError

# Name of the variable that says how much memory a run may take, in all its processes.
LIMIT = "FFD_MEMORY"
_LINUX = sys.platform == "linux"
_UNITS = {"": 1, "K": 1e3, "M": 1e6, "G": 1e9, "T": 1e12}
_BINARY = {"K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}
_AMOUNT = re.compile(r"([0-9]*\.?[0-9]+)\s*([KMGT]?)(I?)B?")


def parse_amount(text: str) -> float:
    """Bytes of an amount such as ``12GB``, ``12GiB``, ``500M`` or ``none``, which is no limit.

    Raises
    ------
    FfdError
    """
    found = _AMOUNT.fullmatch(text.strip().upper())
    if text.strip().lower() == "none":
        return math.inf
    if found is None or (found[3] and not found[2]) or not float(found[1]):
        raise FfdError(
            f"{text!r} is no amount of memory",
            hint="write 12GB, 12GiB, 500MB, or none for no limit",
        )
    return float(found[1]) * (_BINARY if found[3] else _UNITS)[found[2]]


def memory_limit() -> float | None:
    """Bytes that FFD_MEMORY allows; None where it is not set.

    Raises
    ------
    FfdError
        It is no amount of memory.
    """
    text = os.environ.get(LIMIT, "")
    try:
        return parse_amount(text) if text.strip() else None
    except FfdError as error:
        raise FfdError(f"the variable {LIMIT}: {error.message}", hint=error.hint) from None


def available_bytes() -> int:
    """Free memory of the machine, or of the control groups of this process if that is less."""
    return min([_free(), *_rooms(Path("/proc/self/cgroup"), Path("/sys/fs/cgroup"))])


def resident_bytes(process: int) -> int:
    """Resident memory of a process; 0 if it has ended."""
    # On Linux it takes longer to load the library than to look.
    if _LINUX:
        with suppress(OSError):
            pages = Path(f"/proc/{process}/statm").read_text().split()[1]
            return int(pages) * os.sysconf("SC_PAGESIZE")
        return 0
    import psutil

    with suppress(psutil.Error):
        return int(psutil.Process(process).memory_info().rss)
    return 0


def held_bytes() -> int:
    """Resident memory of this process and of those that it has started."""
    return sum(map(resident_bytes, _tree(os.getpid())))


def _tree(process: int) -> Iterator[int]:
    """A process and all that it has started."""
    yield process
    if _LINUX:
        with suppress(OSError):
            for task in Path(f"/proc/{process}/task").iterdir():
                for child in (task / "children").read_text().split():
                    yield from _tree(int(child))
        return
    import psutil

    with suppress(psutil.Error):
        yield from (each.pid for each in psutil.Process(process).children(recursive=True))


def _free() -> int:
    """Memory that the machine can give."""
    with suppress(OSError):
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024 * int(line.split()[1])
    import psutil

    return int(psutil.virtual_memory().available)


def _rooms(membership: Path, mount: Path) -> Iterator[int]:
    """Bytes that each control group of a process, and each group around it, has left.

    Inside a container its own group may be the root of what is mounted, whatever the path says.

    Parameters
    ----------
    membership : Path
        The file of the kernel that lists the groups.
    mount : Path
        Where groups are mounted.
    """
    lines: list[str] = []
    with suppress(OSError):
        lines = membership.read_text().splitlines()
    for line in lines:
        number, kinds, inner = line.split(":", 2)
        if number == "0":
            files, root = ("memory.max", "memory.current", "inactive_file"), mount
        elif "memory" in kinds.split(","):
            root = mount / "memory"
            files = "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"
        else:
            continue
        folder = root / inner.lstrip("/")
        for group in (folder, *folder.parents):
            if group.is_relative_to(root):
                yield from _room(group, *files)


def _room(group: Path, limit: str, usage: str, cache: str) -> Iterator[int]:
    """Bytes left in one control group that has a limit; pages of files are given up when needed."""
    with suppress(OSError, ValueError):
        most = int((group / limit).read_text())
        used = int((group / usage).read_text())
        for line in (group / "memory.stat").read_text().splitlines():
            name, _, value = line.partition(" ")
            if name == cache:
                used -= int(value)
        yield max(0, most - used)
