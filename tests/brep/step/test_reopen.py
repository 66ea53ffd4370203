"""A file opened again piece by piece: damage to its structure is found wherever pieces end."""

import random
import re

import pytest

from ffdcli.brep.labels import label_shape
from ffdcli.brep.step.reopen import require_sound_file
from ffdcli.brep.step.write import write_step
from ffdcli.errors import KernelError
from support import brep_models as models

SIZES = (50, 1000, 10**6)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("step") / "a.step"
    brep = models.cube(models.bumpy)
    write_step(brep, path, labels=label_shape(brep, "it's (5')", None))
    return path


@pytest.fixture(scope="module")
def count(written):
    return len(re.findall(rb"^#\d+=", written.read_bytes(), re.M))


@pytest.mark.parametrize("size", SIZES)
def test_whole_files_pass(written, count, size):
    require_sound_file(written, count, size)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        (rb"\A", b"\n", "its first line is missing"),
        (rb"END-ISO-10303-21;\n\Z", b"", "its last line is missing"),
        (rb"\n#9=[^;]*;", b"", "entity #9 is not where it should be"),
        (rb"\n#9=", b"\n#8=", "entity #9 is not where it should be"),
        (rb"\(#1,", b"(#99999999,", "not among #1"),
        (rb"\(#1,", b"(#0,", "not among #1"),
        (rb"\(#1,", b"((#1,", "parentheses of the statement at byte"),
        (rb"\(#1,", b"'(#1,", "text"),
        (rb"\(#1,", b"(\xe9#1,", "no character of such files"),
    ],
)
def test_damage_is_found(written, count, tmp_path, size, old, new, fault):
    content, changed = re.subn(old, lambda _: new, written.read_bytes(), count=1)
    assert changed == 1
    damaged = tmp_path / "b.step"
    damaged.write_bytes(content)
    with pytest.raises(KernelError, match=fault):
        require_sound_file(damaged, count, size)


def test_entities_are_counted(written, count):
    with pytest.raises(KernelError, match=f"it has {count} entities instead of {count + 1}"):
        require_sound_file(written, count + 1)


def test_a_file_that_ends_early_is_refused(written, count, tmp_path):
    content, cut = written.read_bytes(), tmp_path / "cut.step"
    ends = random.Random(1)
    for _ in range(40):
        cut.write_bytes(content[: ends.randrange(1, len(content) - 1)])
        with pytest.raises(KernelError):
            require_sound_file(cut, count, 300)
