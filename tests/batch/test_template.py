"""Parameters in the text of lattice files."""

import pytest

from ffdcli.batch.template import fill
from ffdcli.errors import LatticeError
from ffdcli.lattice.file.load import parse_spec
from ffdcli.lattice.file.source import parse_yaml
from ffdcli.messages import printable


def test_values_as_yaml_reads_them():
    text = "a: ${a}\nb: ${ b }\nc: [${c}]\nd: ${d}\ne: ${e}\nf: '$${a}'\n"
    values = {"a": 0.1, "b": True, "c": 3, "d": (1, 2.5), "e": "x y", "idle": 1}
    filled, idle = fill(text, values, "l.yaml")
    data, _ = parse_yaml(filled)
    assert data == {"a": 0.1, "b": True, "c": [3], "d": [1, 2.5], "e": "x y", "f": "${a}"}
    assert idle == ["idle"]


@pytest.mark.parametrize("value", [1e-300, 1 / 3, -2.5e17, 123456789012345678])
def test_numbers_keep_every_bit(value):
    filled, _ = fill("a: ${a}\n", {"a": value}, "l.yaml")
    assert parse_yaml(filled)[0]["a"] == value


def test_missing_value_names_the_line():
    with pytest.raises(LatticeError, match="there is no value for") as caught:
        fill("a: 1\n\nb: ${amplitud}\n", {"amplitude": 1}, "l.yaml")
    assert (caught.value.file, caught.value.line) == ("l.yaml", 3)
    assert "amplitude" in caught.value.hint


def test_text_that_parameters_would_make_too_long_is_refused_before_it_is_made():
    # A thousand places for a million characters each.
    with pytest.raises(
        LatticeError, match=r"1,000,\d{3},\d{3} characters; 67,108,864 are"
    ) as caught:
        fill("- ${a}\n" * 1000, {"a": "x" * 10**6}, "l.yaml")
    assert caught.value.file == "l.yaml"


@pytest.mark.parametrize(
    "value",
    [float("nan"), float("inf"), 1e300, -1e31, True, (), ((1,),), "", "a\0", "\ud800", "]}\n- a: 1",
     "9" * 5000, 10**24, "*a", "&a 1", "!!python/name:os", "${a}", "[" * 3000, "x" * 10**5],
)  # fmt: skip
@pytest.mark.parametrize(
    "text",
    ["edits:\n- move: {at: [1, 1, 1], by: [0, 0, ${a}]}\n", "points: [4, 4, ${a}]\n",
     "edits:\n- net: ${a}\n", "${a}: 3\n", "unit: '${a}'\n"],
)  # fmt: skip
def test_any_value_in_any_place_is_taken_or_refused_in_one_sentence(text, value):
    filled, _ = fill(f"version: 1\n{text}", {"a": value}, "l.yaml")
    refused = None
    try:
        spec = parse_spec(*parse_yaml(filled, "l.yaml"))
    except LatticeError as error:
        refused = error
    if refused is None:
        assert spec.version == 1
        return
    assert refused.file == "l.yaml"
    assert len(printable(str(refused))) < 600
