"""Parameters in the text of lattice files."""

import pytest

from ffdcli.batch.template import fill
from ffdcli.errors import LatticeError
from ffdcli.lattice.file.source import parse_yaml


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
