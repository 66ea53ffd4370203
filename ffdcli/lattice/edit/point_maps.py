"""What each edit does to a control net: pure functions of arrays.

Nets are (nu, nv, nw, 3) float64, or any (..., 3), in the lattice frame; angles are degrees,
right-handed. `twist`, `taper` and `bend` measure along the axis from the low side of the box over
its length; control points beyond the box (unclamped ends, earlier edits) continue the same law.
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
    # What is not turned keeps its last bit.
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
    # A factor of 1 changes nothing, not even the last bit; a factor of 0 hits the centre exactly.
    out = np.where(scale == 1.0, points, centre + scale * (points - centre))
    if rotation is not None:
        axis, angle = rotation
        out = rotate(out, axis, np.asarray(angle), centre)
    return np.asarray(out + translate)


def twist(net: Floats, box: Floats, axis: int, degrees: float) -> Floats:
    """The net turned about the box's centre line, linearly from 0 to ``degrees`` along an axis."""
    return rotate(net, axis, degrees * _fraction(net, box, axis), box.mean(axis=0))


def taper(net: Floats, box: Floats, axis: int, factor: float) -> Floats:
    """The net scaled towards the box's centre line, linearly from 1 to ``factor`` along an axis."""
    change = (factor - 1.0) * _fraction(net, box, axis)
    out = net.copy()
    for other in ((axis + 1) % 3, (axis + 2) % 3):
        centre = (box[0, other] + box[1, other]) / 2
        out[..., other] += (net[..., other] - centre) * change
    return out


def bend(net: Floats, box: Floats, axis: int, toward: int, degrees: float) -> Floats:
    """The net with the box's centre line laid on an arc of the same length.

    The centre line keeps its low end and its direction there, and turns by ``degrees`` towards
    the axis ``toward`` over its length L. With s the length from the low end, a the angle in
    radians, p = a s / L, and t the distance from the centre line along ``toward``::

        along  = s sinc(p)               - t sin(p)
        across = s sin(p/2) sinc(p/2)    + t cos(p)         sinc(x) = sin(x) / x

    which is the arc of radius L / a, written so that it holds for an angle of 0 too.
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
    """0 at the low side of the box, 1 at the high side, linear beyond."""
    return np.asarray((net[..., axis] - box[0, axis]) / (box[1, axis] - box[0, axis]))
