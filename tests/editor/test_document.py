"""The text of a lattice file: nothing but entries changes, whatever the file looks like."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ffdcli.editor.document import digest_of, new_document, read_document
from ffdcli.editor.entry_text import WIDTH, entry_lines, entry_of_text, entry_text, plain_values
from ffdcli.errors import LatticeError
from ffdcli.lattice.file.source import parse_yaml

TWIST = {"twist": {"axis": "w", "angle": 3}}
TAPER = {"taper": {"axis": "u", "factor": 0.5}}
MOVE = {"move": {"at": [":", "1:3", -1], "by": [0.1, 1e-07, 3.0]}}

COMMENTED = """\
# A lattice of mine; é
version: 1   # always

degree: [3,  3, 3]
edits:   # what I did
  # the top first
  - move: {at: [3, 3, 5], by: [0, 0, 10.50]}  # up

  # then a pull
  - drag:
      pairs:
        - {from: [1,2,3], to: [1,2,8]}
      # not more
  # last
  - twist: {axis: w,
      angle: 3}   # turned
# the end
unit: mm
"""


def document(tmp_path, text):
    path = tmp_path / "l.yaml"
    path.write_bytes(text.encode())
    return read_document(path)


def changed(document, change):
    return document.with_edits((change(list(document.edits[0])), *document.edits[1:]))


def test_an_entry_more_leaves_all_other_bytes(tmp_path):
    found = changed(document(tmp_path, COMMENTED), lambda all_: (*all_, TAPER))
    line = "      angle: 3}   # turned\n"
    put = line + "  - taper: {axis: u, factor: 0.5}\n"
    assert found.text == COMMENTED.replace(line, put)


def test_an_entry_goes_with_its_lines_and_comes_back_with_them(tmp_path):
    first = document(tmp_path, COMMENTED)
    shorter = first.with_edits((first.edits[0][::2],))
    gone = COMMENTED[COMMENTED.index("  - drag:") : COMMENTED.index("  # last")]
    assert shorter.text == COMMENTED.replace(gone, "")
    assert first.with_edits(first.edits).text == COMMENTED


def test_another_entry_stands_where_the_old_one_stood(tmp_path):
    found = changed(document(tmp_path, COMMENTED), lambda all_: (all_[0], TAPER, all_[2]))
    old = COMMENTED[COMMENTED.index("  - drag:") : COMMENTED.index("  # last")]
    assert found.text == COMMENTED.replace(old, "  - taper: {axis: u, factor: 0.5}\n")


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("version: 1\nedits:\n\n  # - move: x\n", "version: 1\nedits:\n  - N\n\n  # - move: x\n"),
        ("version: 1", "version: 1\nedits:\n  - N\n"),
        ("version: 1\nbox:\n  auto\n  # or\n", "version: 1\nbox:\n  auto\n  # or\nedits:\n  - N\n"),
        ("version: 1\nedits: null\nunit: mm\n", "version: 1\nedits:\n  - N\nunit: mm\n"),
        ("version: 1\nedits: [] # none\n", "version: 1\nedits: # none\n  - N\n"),
        ("\ufeffversion: 1\r\nedits:\r\n- O\r\n", "\ufeffversion: 1\r\nedits:\r\n- O\r\n- N\r\n"),
        ("version: 1\nedits:\n    - O", "version: 1\nedits:\n    - O\n    - N\n"),
        ("version: 1\nedits:\n-\n  # a\n  O\n", "version: 1\nedits:\n-\n  # a\n  O\n- N\n"),
        ("version: 1\nedits: [{O}, # a\n]\n", "version: 1\nedits:\n  # a\n  - O\n  - N\n"),
        ('{"version": 1}', '{"version": 1, "edits": [J]}'),
        ('{"edits": [], "version": 1}', '{"edits": [J], "version": 1}'),
        ("version: 1\nedits: &all\n  - O\n", "version: 1\nedits: &all\n  - O\n  - N\n"),
    ],
)  # fmt: skip
def test_all_ways_to_write_a_list(tmp_path, text, wanted):
    def fill(form):
        form = form.replace("N", entry_text(TAPER)).replace("O", entry_text(TWIST))
        return form.replace("J", json.dumps(TAPER))

    found = changed(document(tmp_path, fill(text)), lambda all_: (*all_, TAPER))
    assert found.content.decode() == fill(wanted)


def test_each_lattice_of_a_list_has_its_own_entries(tmp_path):
    text = (
        "version: 1\nlattices:\n  - box: {min: [0, 0, 0], max: [1, 1, 1]}\n    edits:\n"
        "    - twist: {axis: w, angle: 3}\n  # two\n  - box: {min: [1, 0, 0], max: [2, 1, 1]} # k\n"
    )
    found = document(tmp_path, text).with_edits(((TWIST, TAPER), (MOVE,)))
    assert found.edits == ((TWIST, TAPER), (MOVE,))
    assert "# two\n" in found.text
    assert found.text.endswith("# k\n    edits:\n      - " + entry_text(MOVE) + "\n")
    assert parse_yaml(found.text)[0] == found.values


def test_aliases_are_kept_or_written_out(tmp_path):
    text = "version: 1\nedits:\n  - twist: &t {axis: w, angle: 3}\n  - twist: *t\n"
    both = document(tmp_path, text)
    assert changed(both, lambda all_: (*all_, TAPER)).text.startswith(text)
    alone = changed(both, lambda all_: (TAPER, all_[1]))
    assert parse_yaml(alone.text)[0]["edits"] == [TAPER, TWIST]


def test_an_anchor_that_other_keys_need_is_named(tmp_path):
    text = "version: 1\nedits:\n  - move: {at: &d [3, 3, 3], by: [0, 0, 1]}\ndegree: *d\n"
    with pytest.raises(LatticeError, match="anchor"):
        changed(document(tmp_path, text), lambda _: (TAPER,))


def test_a_file_that_is_no_lattice_is_refused_with_its_line(tmp_path):
    with pytest.raises(LatticeError) as caught:
        document(tmp_path, "version: 1\nedits:\n  - twist: {axis: q, angle: 3}\n")
    assert caught.value.line == 3


def test_the_digest_is_of_the_bytes(tmp_path):
    found = document(tmp_path, COMMENTED)
    assert digest_of(found.path) == found.digest
    found.path.write_bytes(b" " + COMMENTED.encode())
    assert digest_of(found.path) != found.digest
    assert new_document(tmp_path / "x.yaml", COMMENTED).digest is None
    assert digest_of(tmp_path / "x.yaml") is None


ENTRIES = st.one_of(
    st.just(TWIST),
    st.just(TAPER),
    st.builds(
        lambda number, by: {"move": {"at": [number, ":", "0:2"], "by": by}},
        st.integers(-3, 3),
        st.lists(st.floats(-1e9, 1e9), min_size=3, max_size=3),
    ),
    st.builds(
        lambda rows: {"drag": {"pairs": [{"from": row, "by": row} for row in rows]}},
        st.lists(st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3), min_size=1, max_size=9),
    ),
)


@given(
    before=st.lists(ENTRIES, max_size=5), after=st.lists(ENTRIES, max_size=5), style=st.booleans()
)
def test_any_entries_read_back_and_comments_stay(tmp_path_factory, before, after, style):
    path = tmp_path_factory.mktemp("d") / "l.yaml"
    lines = ["# head", "version: 1", "edits: # list" if before or not style else "edits: [] # list"]
    for number, entry in enumerate(before):
        lines += [f"  # comment {number}", *entry_lines(entry, 2)]
    text = "\n".join([*lines, "unit: mm  # tail", ""])
    found = new_document(path, text).with_edits((tuple(after),))
    assert parse_yaml(found.text)[0] == {"version": 1, "edits": after, "unit": "mm"} or not after
    assert [line for line in found.text.splitlines() if line.strip().startswith("# comment")] == [
        f"  # comment {number}" for number in range(len(before))
    ]
    assert "# list" in found.text
    # Back again, from the new text.
    again = new_document(path, found.text).with_edits((tuple(before),))
    assert again.edits[0] == tuple(before)


@given(st.floats(allow_nan=False, allow_infinity=False, min_value=-1e30, max_value=1e30))
def test_numbers_are_short_and_the_same_double(value):
    edit = {"move": {"at": [0, 0, 0], "by": [value, 0.0, -value]}}
    text = entry_text(edit)
    found = parse_yaml(text)[0]["move"]["by"]
    assert [float(each) for each in found] == edit["move"]["by"]
    assert len(text) <= len(repr(edit))


def test_entries_are_written_as_a_person_would():
    assert entry_text(MOVE) == 'move: {at: [":", "1:3", -1], by: [0.1, 1e-07, 3]}'
    assert entry_text({"net": "nets/a-1.npy"}) == "net: nets/a-1.npy"
    assert entry_text({"net": "my net: 1.npy"}) == 'net: "my net: 1.npy"'
    assert entry_text({"drag": {"hold": [{"group": "no"}]}}) == 'drag: {hold: [{group: "no"}]}'
    many = {
        "drag": {"pairs": [{"from": [n, 0, 0], "to": [n, 1.5, 0]} for n in range(9)], "pin": []}
    }
    lines = entry_lines(many, 2)
    assert lines[:3] == [
        "  - drag:",
        "      pairs:",
        "        - {from: [0, 0, 0], to: [0, 1.5, 0]}",
    ]
    assert max(map(len, lines)) <= WIDTH
    assert parse_yaml("edits:\n" + "\n".join(lines))[0] == {"edits": [many]}


def test_edits_of_arrays_become_plain():
    given_ = {"move": {"at": (np.int64(3), 0, 1), "by": np.array([1.0, 2, 3])}}
    found = plain_values(given_)
    assert found == {"move": {"at": [3, 0, 1], "by": [1.0, 2.0, 3.0]}}
    assert json.dumps(found)


@pytest.mark.parametrize(
    "text", ["twist: {axis: w, angle: 3}", "- twist:\n    axis: w\n    angle: 3"]
)
def test_an_entry_is_read_with_its_dash_or_without(text):
    assert entry_of_text(text) == TWIST


@pytest.mark.parametrize("text", ["", "twist", "- a\n- b", "twist: {", "{twist: 1, taper: 2}"])
def test_what_is_no_entry_is_refused(text):
    with pytest.raises(LatticeError):
        entry_of_text(text)
