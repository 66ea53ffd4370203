"""Bézier form of the polynomial pieces of B-spline surfaces."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.evaluate.bspline import SurfaceBatch


def pieces_of(batch: SurfaceBatch) -> Floats:
    """Bézier points of every polynomial piece of every surface.

    Returns
    -------
    (m, Ju, Jv, degree_v + 1, degree_u + 1, 3 or 4) float64
        For ``Ju`` by ``Jv`` intervals between knots.
    """
    along_u = _along(batch.poles, batch.degrees[0], batch.u_knots, batch.u_mults)
    along_v = _along(along_u.transpose(0, 3, 1, 2, 4), batch.degrees[1], batch.v_knots,
                     batch.v_mults)  # fmt: skip
    return np.ascontiguousarray(along_v.transpose(0, 3, 1, 2, 4, 5))


def _along(poles: Floats, degree: int, knots: Floats, mults: Ints) -> Floats:
    """Bézier points (m, J, degree + 1, ...) along the second axis of poles (m, n, ...)."""
    if len(mults) == 2:
        return poles[:, None]
    flat = np.repeat(knots, mults, axis=1)
    extra = (1,) * (poles.ndim - 2)
    pieces = []
    number = np.arange(degree + 1)
    for span in (np.cumsum(mults)[:-1] - 1).tolist():
        # Bézier point i is the blossom at the lower end, degree - i times, and the upper, i times.
        local = poles[:, None, span - degree : span + 1]
        for r in range(1, degree + 1):
            left = flat[:, None, span - degree + r : span + 1]
            right = flat[:, None, span + 1 : span + degree + 2 - r]
            at = np.where(r <= degree - number, flat[:, span, None], flat[:, span + 1, None])
            share = (at[:, :, None] - left) / (right - left)
            share = share.reshape(*share.shape, *extra)
            local = (1 - share) * local[:, :, :-1] + share * local[:, :, 1:]
        pieces.append(local[:, :, 0])
    return np.stack(pieces, axis=1)
