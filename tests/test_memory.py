"""Memory that can be had: amounts, and the limits of control groups of both versions."""

import math
import os
import subprocess
import sys

import pytest

from ffdcli import memory
from ffdcli.errors import FfdError
from ffdcli.memory import (
    LIMIT,
    available_bytes,
    held_bytes,
    memory_limit,
    parse_amount,
    resident_bytes,
)

V2 = ("memory.max", "memory.current", "inactive_file")
V1 = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("12GB", 12e9),
        (" 1.5 gib ", 1.5 * 2**30),
        ("500M", 500e6),
        (".5K", 500),
        ("4096", 4096),
        ("7b", 7),
        ("2TiB", 2 * 2**40),
        ("none", math.inf),
    ],
)
def test_amounts(text, wanted, monkeypatch):
    assert parse_amount(text) == wanted
    monkeypatch.setenv(LIMIT, text)
    assert memory_limit() == wanted


@pytest.mark.parametrize("text", ["much", "12 apples", "-3GB", "0", "1e9", "3iB", "GB"])
def test_what_is_no_amount(text, monkeypatch):
    with pytest.raises(FfdError, match="is no amount of memory"):
        parse_amount(text)
    monkeypatch.setenv(LIMIT, text)
    with pytest.raises(FfdError, match="the variable FFD_MEMORY"):
        memory_limit()


def test_no_limit_where_none_is_set(monkeypatch):
    monkeypatch.delenv(LIMIT, raising=False)
    assert memory_limit() is None


def group(folder, names, limit, used, cache=0):
    folder.mkdir(parents=True, exist_ok=True)
    for name, value in zip(names, (limit, used), strict=False):
        (folder / name).write_text(f"{value}\n")
    (folder / "memory.stat").write_text(f"anon 5\n{names[2]} {cache}\n")


def rooms(tmp_path, text):
    (tmp_path / "cgroup").write_text(text)
    return sorted(memory._rooms(tmp_path / "cgroup", tmp_path / "mount"))


def test_version_2_counts_all_groups_around_the_own_one(tmp_path):
    group(tmp_path / "mount/a/b", V2, "max", 10)
    group(tmp_path / "mount/a", V2, 1000, 400, 100)
    group(tmp_path / "mount", V2, 5000, 500)
    assert rooms(tmp_path, "0::/a/b\n") == [700, 4500]


def test_version_1(tmp_path):
    # Without a limit there is a number as large as can be.
    group(tmp_path / "mount/memory/a", V1, 1000, 400, 100)
    group(tmp_path / "mount/memory", V1, 2**63 - 4096, 500)
    text = "5:cpu:/x\n4:cpuset,memory:/a\n1:name=systemd:/a\n0::/a\n"
    assert rooms(tmp_path, text)[0] == 700
    assert rooms(tmp_path, text)[1] > 2**62


@pytest.mark.parametrize(("line", "names", "below"), [("0::", V2, ""), ("4:memory:", V1, "memory")])
def test_inside_a_container_the_own_group_is_what_is_mounted(tmp_path, line, names, below):
    group(tmp_path / "mount" / below, names, 1000, 950)
    assert rooms(tmp_path, f"{line}/docker/1f2e\n") == [50]
    assert rooms(tmp_path, f"{line}/\n") == [50]


def test_more_used_than_allowed_leaves_nothing(tmp_path):
    group(tmp_path / "mount", V2, 1000, 1200)
    assert rooms(tmp_path, "0::/\n") == [0]


def test_no_groups(tmp_path):
    assert rooms(tmp_path, "") == []
    assert list(memory._rooms(tmp_path / "no", tmp_path)) == []


def test_this_machine_has_some():
    import psutil

    free = psutil.virtual_memory().available
    # Others take and free memory meanwhile.
    assert 1e6 < available_bytes() < free + 0.2 * psutil.virtual_memory().total
    told = psutil.Process().memory_info().rss
    assert abs(resident_bytes(os.getpid()) - told) < 0.1 * told
    assert resident_bytes(2**22 + 12345) == 0


def test_what_started_processes_hold_is_held():
    alone = held_bytes()
    size = 200_000_000
    hold = f"data = bytearray(b'x') * {size}; print(len(data), flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", hold], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        assert child.stdout.readline() == b"%d\n" % size
        assert held_bytes() > alone + 0.9 * size
        child.communicate(b"\n")
    assert held_bytes() < alone + 0.5 * size
