"""Selectors: which control points they name."""

import numpy as np
import pytest

from ffdcli.lattice.file.model_base import Corners
from ffdcli.lattice.file.selectors import Inside, Near, entry_indices, select

REST = np.stack(
    np.meshgrid(np.linspace(0, 3, 4), np.linspace(0, 4, 5), np.linspace(0, 5, 6), indexing="ij"),
    axis=-1,
)


@pytest.mark.parametrize(
    ("entry", "want"),
    [
        (0, [0]),
        (-1, [5]),
        ((3, -1, 3), [3, 5]),
        (":", [0, 1, 2, 3, 4, 5]),
        ("1:3", [1, 2]),
        ("-2:", [4, 5]),
        (":-4", [0, 1]),
        ("4:99", [4, 5]),
    ],
)
def test_entries(entry, want):
    assert entry_indices(entry, 6).tolist() == want


def test_three_entries_select_their_product():
    chosen = select(("1:3", (0, -1), 2), REST)
    assert [tuple(p) for p in np.argwhere(chosen).tolist()] == [
        (1, 0, 2),
        (1, 4, 2),
        (2, 0, 2),
        (2, 4, 2),
    ]


def test_inside_takes_the_sides_and_forgives_rounding():
    rest = REST * 0.1  # 0.30000000000000004 at index 3
    box = Corners(min=(0.0, 0.1, 0.3), max=(0.3, 0.1, 0.3))
    chosen = select(Inside(inside=box), rest)
    assert np.argwhere(chosen).tolist() == [[i, 1, 3] for i in range(4)]


def test_near_takes_the_nearest_and_the_first_of_equals():
    assert np.argwhere(select(Near(near=(1.2, 3.9, 9.0)), REST)).tolist() == [[1, 4, 5]]
    assert np.argwhere(select(Near(near=(0.5, 0.0, 0.0)), REST)).tolist() == [[0, 0, 0]]
