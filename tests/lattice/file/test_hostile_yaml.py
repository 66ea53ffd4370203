"""YAML that would take memory or time without bound is refused; long files are read in full."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.errors import FfdError, LatticeError
from ffdcli.lattice.file import source
from ffdcli.lattice.file.load import parse_spec
from ffdcli.lattice.file.source import parse_yaml
from ffdcli.lattice.lattice_file import load_lattice
from support.damage import damage

V = "version: 1\n"


def refusal(text):
    with pytest.raises(LatticeError) as caught:
        parse_spec(*parse_yaml(text, "l.yaml"))
    assert caught.value.file == "l.yaml"
    return caught.value


def test_values_behind_aliases_count_each_time():
    # Ten levels of ten aliases: 10**10 values in some 400 bytes.
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 10)]
    error = refusal(V + "\n".join(lines) + "\n")
    assert "more than 2,000,000 values" in error.message
    # The tenth alias of level 6 would repeat 10**6 values again, after 2.2 million before.
    assert error.key.startswith("a6") or error.key.startswith("a7")


def test_a_list_is_read_no_further_than_the_limit(monkeypatch):
    drawn = []

    def counted(text, Loader):
        for event in events_of(text, Loader):
            drawn.append(event)
            yield event

    events_of = source.yaml.parse
    monkeypatch.setattr(source.yaml, "parse", counted)
    monkeypatch.setattr(source, "MAX_VALUES", 1000)
    assert refusal(V + f"degree: [{'1, ' * 5000}]\n").key == "degree[997]"
    assert len(drawn) < 1010


def test_aliases_repeat_values():
    data, _ = parse_yaml("a: &x [1, {b: 2}]\nc: *x\nd: &n 3\ne: [*n, *n]\n")
    assert data == {"a": [1, {"b": 2}], "c": [1, {"b": 2}], "d": 3, "e": [3, 3]}


@pytest.mark.parametrize("text", ["a: *b\n", "a: &b [*b]\n", "a: &b {c: [*b]}\n"])
def test_aliases_without_values_are_refused(text):
    assert "alias" in refusal(text).message or "contains itself" in refusal(text).message


def test_a_new_anchor_of_the_same_name_replaces_the_old():
    assert parse_yaml("a: &x 1\nb: *x\nc: &x 2\nd: *x\n")[0] == {"a": 1, "b": 1, "c": 2, "d": 2}


@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "? "])
def test_deep_nesting_is_refused(opening):
    for depth in (21, 900, 100_000):
        assert refusal("a:\n  " + opening * depth + "\n").message


def test_nesting_behind_aliases_counts():
    text = "a: &a " + "[" * 12 + "]" * 12 + "\nb: " + "[" * 10 + "*a" + "]" * 10 + "\n"
    assert "more than 20 deep" in refusal(text).message


@pytest.mark.parametrize(
    "number", ["9" * 5000, "-" + "9" * 5000, "9" * 400, "1e300", "-1e31", "0x" + "f" * 3000]
)
@pytest.mark.parametrize("line", ["points: [%s, 4, 4]", "edits: [{twist: {axis: u, angle: %s}}]"])
def test_huge_numbers_are_refused(number, line):
    error = refusal(V + line % number + "\n")
    assert "too large" in error.message
    assert error.line == 2
    assert len(error.message) < 120


def test_long_slices_are_refused():
    at = f'["0:{"9" * 5000}", 0, 0]'
    error = refusal(V + f"edits: [{{move: {{at: {at}, by: [0, 0, 1]}}}}]\n")
    assert "slice" in error.message


@pytest.mark.parametrize("tag", ["!!python/tuple", "!anything", "!<x>", "!!set", "!!binary"])
@pytest.mark.parametrize("value", ["[3, 3, 3]", "{a: 1}", "word"])
def test_tags_are_refused_by_name_and_line(tag, value):
    error = refusal(f"{V}degree: {tag} {value}\n")
    assert (error.line, error.key) == (2, "degree")
    assert tag.strip("!<>") in error.message


@pytest.mark.parametrize("key", ['"\\ud800"', '"a\\udfff"'])
def test_surrogates_are_refused(key):
    assert "not valid YAML" in refusal(f"{V}{key}: 1\n").message
    assert "not valid YAML" in refusal(f"{V}unit: {key}\n").message


def test_surrogates_in_python_text_are_refused():
    assert "not valid YAML" in refusal("a: \ud800\n").message


def test_plain_words_have_the_types_of_yaml_1_2():
    text = "[1, -2, +3, 0x1F, 0o17, 0b11, 010, 1_000, .5, 1., 1e-3, 1.5E+2, -.inf, true, FALSE, "
    text += "null, ~, no, on, 2:4, 2001-01-01, _, 1e, e1, '1', \"true\", !!str 5, !!float 5]"
    expected = [1, -2, 3, 31, 15, 3, 10, 1000, 0.5, 1.0, 1e-3, 150.0, -np.inf, True, False]
    expected += [None, None, "no", "on", "2:4", "2001-01-01", "_", "1e", "e1", "1", "true", "5", 5]
    found = parse_yaml(text)[0]
    assert found == expected
    assert [type(item) for item in found[:-1]] == [type(item) for item in expected[:-1]]


def test_many_edits_are_read_with_the_line_of_each():
    count = 5000
    edit = "- move:\n    at: [0, 0, 0]\n    by: [0, 0, 1]\n"
    data, lines = parse_yaml(V + "edits:\n" + edit * count)
    assert len(parse_spec(data, lines).edits) == count
    assert lines.line(("edits", 4000, "move", "by", 2)) == 3 + 3 * 4000 + 2
    # Only lines that differ from those of what is around them take memory.
    assert len(lines.lines) < 3 * count + 10


def test_only_the_first_of_many_wrong_edits_is_reported():
    error = refusal(V + "edits:\n" + "- move: {at: [0, 0], by: [0, 0, 1]}\n" * 2000)
    assert (error.line, error.key) == (3, "edits[0].move.at")


def test_more_values_than_the_limit_are_refused(monkeypatch):
    monkeypatch.setattr(source, "MAX_VALUES", 100)
    # The list itself counts too.
    assert len(parse_yaml(f"[{'1, ' * 99}]")[0]) == 99
    assert "more than 100 values" in refusal(f"[{'1, ' * 100}]").message


def test_files_larger_than_the_limit_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(source, "MAX_BYTES", 1 << 20)
    path = tmp_path / "l.yaml"
    path.write_text(V + "#" * (1 << 20))
    with pytest.raises(LatticeError, match="more than 1 MiB"):
        load_lattice(path)


GOOD = b"""version: 1
volume: nurbs   # a comment
degree: [3, 3, 3]
points: [5, 5, 5]
box: {min: [0, 0, 0], max: &top [10.5, 1e1, 4]}
edits:
  - move: {at: ["1:3", [0, 2], -1], by: [0, 0.5, 1e-3]}
  - twist: {axis: w, angle: 30}
  - weight: {at: {near: *top}, value: 2.5}
  - drag: {pairs: [{from: [1, 1, 1], to: [1, 1, 2]}], hold: [{group: "a\\tb"}]}
"""
BITS = (b"*top", b"&a", b"!!python/x ", b"9" * 5000, b"1e999", b".nan", b'"\\ud800"', b"[" * 30)
BITS += (b"{", b"- ", b"\n", b"\0", b": ", b"\xff", b"'", b"%")


@settings(max_examples=150, deadline=None, derandomize=True, database=None)
@given(st.data())
def test_damaged_files_are_read_or_refused(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("damaged") / "l.yaml"
    path.write_bytes(damage(GOOD, data, BITS))
    refused = None
    try:
        lattice = load_lattice(path)
    except FfdError as error:
        refused = error
    if refused is None:
        assert lattice.definitions[0].spec.version == 1
        return
    assert refused.file == str(path)
    assert len(re.sub(re.escape(str(path)), "", str(refused))) < 600
