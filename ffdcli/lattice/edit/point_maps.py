"""Maps of points: rotate, transform, twist, taper, bend.

Points are (..., 3) float64 in the lattice frame; angles are in degrees, right-handed. `twist`,
`taper` and `bend` depend linearly on the coordinate along the axis, from the low side of the box to
its high side and also beyond the box.
"""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats


def cos_sin(degrees: Floats) -> tuple[Floats, Floats]:
    """Cosine and sine of angles in degrees, exact at quarter turns."""
    turn = np.remainder(degrees, 360.0)
    radians = np.deg2rad(turn)
    cosine = np.where((turn == 90) | (turn == 270), 0.0, np.cos(radians))
    sine = np.where(turn == 180, 0.0, np.sin(radians))
    return cosine, sine


def rotate(points: Floats, axis: int, degrees: Floats, centre: Floats) -> Floats:
    """Points (..., 3) turned about the line through ``centre`` along an axis, by angles (...)."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    cosine, sine = cos_sin(degrees)
    p = points[..., first] - centre[first]
    q = points[..., second] - centre[second]
    # Points that do not turn keep all bits.
    still = (sine == 0.0) & (cosine == 1.0)
    out = points.copy()
    out[..., first] = np.where(still, points[..., first], centre[first] + (p * cosine - q * sine))
    out[..., second] = np.where(
        still, points[..., second], centre[second] + (p * sine + q * cosine)
    )
    return out


def transform(
    points: Floats,
    *,
    scale: Floats,
    rotation: tuple[int, float] | None,
    translate: Floats,
    centre: Floats,
) -> Floats:
    """Points (..., 3) scaled, then rotated (axis, degrees), both about ``centre``, then moved."""
    # A factor of 1 keeps all bits; a factor of 0 gives the centre exactly.
    out = np.where(scale == 1.0, points, centre + scale * (points - centre))
    if rotation is not None:
        axis, angle = rotation
        out = rotate(out, axis, np.asarray(angle), centre)
    return np.asarray(out + translate)


def twist(net: Floats, box: Floats, axis: int, degrees: float) -> Floats:
    """Points turned about the centre line of the box, by 0 to ``degrees`` along an axis."""
    return rotate(net, axis, degrees * _fraction(net, box, axis), box.mean(axis=0))


def taper(net: Floats, box: Floats, axis: int, factor: float) -> Floats:
    """Points scaled towards the centre line of the box, by 1 to ``factor`` along an axis."""
    change = (factor - 1.0) * _fraction(net, box, axis)
    out = net.copy()
    for other in ((axis + 1) % 3, (axis + 2) % 3):
        centre = (box[0, other] + box[1, other]) / 2
        out[..., other] += (net[..., other] - centre) * change
    return out


def bend(net: Floats, box: Floats, axis: int, toward: int, degrees: float) -> Floats:
    """Points bent with the centre line of the box, which becomes an arc of the same length.

    The centre line keeps its low end and its direction there, and turns by ``degrees`` towards
    the axis ``toward`` over its length L. With s the length from the low end, a the angle in
    radians, p = a s / L, and t the distance from the centre line along ``toward``::

        along  = s sinc(p)               - t sin(p)
        across = s sin(p/2) sinc(p/2)    + t cos(p)         sinc(x) = sin(x) / x

    This is the arc of radius L / a, in a form that is valid for an angle of 0 too.
    """
    start = box[0, axis]
    centre = (box[0, toward] + box[1, toward]) / 2
    s = net[..., axis] - start
    t = net[..., toward] - centre
    turn = degrees * _fraction(net, box, axis)
    cosine, sine = cos_sin(turn)
    half = np.deg2rad(turn) / 2
    along = s * np.sinc(2 * half / np.pi)
    across = s * np.sin(half) * np.sinc(half / np.pi)
    out = net.copy()
    out[..., axis] = np.where(turn == 0, net[..., axis], start + (along - t * sine))
    out[..., toward] = np.where(turn == 0, net[..., toward], centre + (across + t * cosine))
    return out


def _fraction(net: Floats, box: Floats, axis: int) -> Floats:
    """Position along an axis: 0 at the low side of the box, 1 at the high side."""
    return np.asarray((net[..., axis] - box[0, axis]) / (box[1, axis] - box[0, axis]))
