"""Numbers as text: every double named again by Python's own parser, in the grammar of Part 21."""

import re

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ffdcli.brep.step.text import real, real_rows, references, rounded
from ffdcli.errors import KernelError

# ISO 10303-21, table 2: REAL.
REAL = re.compile(rb"[+-]?\d+\.\d*(E[+-]?\d+)?")
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@settings(max_examples=200)
@given(rows=st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=8))
@example(rows=[(1e-7, -3e300, 5e-324)])
@example(rows=[(-0.0, 1e22, 123456789012345680.0)])
def test_reals_name_the_same_doubles(rows):
    texts = real_rows(np.array(rows))
    assert len(texts) == len(rows)
    for text, row in zip(texts, rows, strict=True):
        parts = text.split(b",")
        assert all(REAL.fullmatch(part) for part in parts)
        found = np.array([float(part) for part in parts])
        assert found.tobytes() == np.array(row).tobytes()


def test_reals_of_nothing_are_empty():
    assert real_rows(np.zeros((0, 3))) == []
    assert real(2.5e-9) == b"2.5E-9"
    assert references(np.array([3, 14])) == b"#3,#14"


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused(bad):
    with pytest.raises(KernelError, match="not finite"):
        real_rows(np.array([[1.0, bad]]))


@settings(max_examples=300)
@given(values=st.lists(NUMBERS, min_size=1, max_size=8), digits=st.integers(3, 17))
@example(values=[0.5, 2.5e-30, 9.9999995, 1e300, 0.0, -0.0, 12345678.5], digits=8)
def test_fewer_digits_are_those_that_python_prints(values, digits):
    found = rounded(np.array(values), digits)
    expected = np.array([float(f"{value:.{digits - 1}E}") for value in values])
    assert found.tobytes() == expected.tobytes()
