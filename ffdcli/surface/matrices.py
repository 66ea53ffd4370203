"""Control points of many surfaces or curves as sums of those of the net, written out."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.splines.composition import in_parts
from ffdcli.splines.local_sums import LocalSums, write_out
from ffdcli.splines.tensor_products import TensorRestriction


def write_items(
    restriction: TensorRestriction, boxes: Ints, weights: Callable[[Ints], Floats]
) -> LocalSums:
    """The sums of all control points of items, item by item.

    Parameters
    ----------
    restriction : TensorRestriction
    boxes : (m, n) int64
        Box of the restriction that each of the n control points of m items comes from.
    weights : callable
        Given items (p,), what their control points take of the net's that reach their boxes:
        (p, ..., prod(k + 1)) float64.
    """
    numbers = np.arange(boxes.size).reshape(boxes.shape)
    # A row of weights takes the room of so many points.
    room = int(np.prod([k + 1 for k in restriction.degrees])) // 3 + 1
    cells = len(restriction.first) // max(1, len(boxes))

    def rows() -> Iterator[tuple[Ints, Floats]]:
        for part in in_parts(np.arange(len(boxes)), cells * room):
            found = weights(part)
            yield numbers[part].ravel(), found.reshape(-1, found.shape[-1])

    return write_out(restriction.degrees, restriction.first, boxes.ravel(), rows())
