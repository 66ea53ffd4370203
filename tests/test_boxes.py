"""Pairs of boxes that meet, against the comparison of each with each."""

import numpy as np
import pytest

from ffdcli import boxes
from ffdcli.boxes import meeting_boxes


def by_definition(low, high):
    return {
        (i, j)
        for i in range(len(low))
        for j in range(i + 1, len(low))
        if all(low[i] < high[j]) and all(low[j] < high[i])
    }


def layout(kind, rng):
    if kind == "scattered":
        low = rng.uniform(0, 5, (150, 3))
        return low, low + rng.uniform(0, 1, (150, 3))
    if kind == "touching":
        low = np.stack(np.meshgrid(*[np.arange(5.0)] * 3), axis=-1).reshape(-1, 3)
        return low, low + 1
    if kind == "nested":
        size = np.arange(1.0, 101)[:, None] * np.ones(3)
        return -size, size
    if kind == "equal":
        return np.zeros((100, 3)), np.ones((100, 3))
    if kind == "flat":
        low = rng.integers(0, 4, (150, 3)).astype(float)
        return low, low + rng.integers(0, 3, (150, 3))
    # One box round many small ones.
    low = rng.uniform(0, 5, (150, 3))
    return np.vstack([low, [[-1, -1, -1]]]), np.vstack([low + 0.3, [[9, 9, 9]]])


@pytest.mark.parametrize("kind", ["scattered", "touching", "nested", "equal", "flat", "round"])
def test_pairs_are_those_of_the_definition(kind):
    low, high = layout(kind, np.random.default_rng(5))
    pairs = [tuple(pair) for pair in meeting_boxes(low, high).tolist()]
    assert len(set(pairs)) == len(pairs)
    assert set(pairs) == by_definition(low, high)


def test_none():
    assert meeting_boxes(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0, 2)


@pytest.mark.parametrize("axes", [(0, 1, 2), (0,)])
def test_the_work_grows_with_the_boxes(monkeypatch, axes):
    """Boxes in a grid, or rods side by side: comparisons for each stay the same."""
    compared = []
    within = boxes._meeting_within

    def counted(some, *rest):
        compared.append(len(some) ** 2)
        return within(some, *rest)

    monkeypatch.setattr(boxes, "_meeting_within", counted)
    for count in (1_000, 8_000):
        side = round(count ** (1 / len(axes)))
        places = np.stack(np.meshgrid(*[np.arange(float(side))] * len(axes)), axis=-1)
        low = np.zeros((side ** len(axes), 3))
        low[:, axes] = places.reshape(-1, len(axes))
        compared.clear()
        assert not len(meeting_boxes(low, low + [0.5, 0.5, 0.5]))
        assert sum(compared) < 100 * count
