"""Equal rows found by their bits, against a dictionary of bytes."""

import numpy as np
import pytest

from ffdcli.brep.step.equal_rows import equal_rows


@pytest.mark.parametrize("width", [2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_rows_are_grouped_by_their_bits(width, seed):
    rng = np.random.default_rng(seed)
    rows = rng.choice([0.0, -0.0, 1.0, 0.1, np.nextafter(0.1, 1)], size=(300, width))
    first, number = equal_rows(rows)
    kinds: dict[bytes, int] = {}
    expected = [kinds.setdefault(row.tobytes(), len(kinds)) for row in rows]
    assert number.tolist() == expected
    assert [rows[i].tobytes() for i in first] == list(kinds)


def test_no_rows_have_no_kinds():
    first, number = equal_rows(np.zeros((0, 3)))
    assert len(first) == len(number) == 0
