"""Points and directions as entities, equal ones once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.step.entities import Entities
from ffdcli.brep.step.equal_rows import equal_rows


def add_points(entities: Entities, uses: Sequence[Floats]) -> list[Ints]:
    """Add points of several arrays (..., 2 or 3), equal ones once: the numbers (...) of each."""
    return add_equal(entities, b"CARTESIAN_POINT('',(%s))", uses)


def add_equal(entities: Entities, template: bytes, uses: Sequence[Floats]) -> list[Ints]:
    """Add an entity for each different row of several arrays (..., k): the numbers (...)."""
    rows = np.concatenate([each.reshape(-1, each.shape[-1]) for each in uses])
    chosen, kind = equal_rows(rows)
    number = entities.add(template, rows[chosen])[kind]
    ends = np.cumsum([each[..., 0].size for each in uses])
    parts = np.split(number, ends[:-1])
    return [part.reshape(each.shape[:-1]) for part, each in zip(parts, uses, strict=True)]
