"""Geometry of the mouse: points in a rectangle on the screen, turns of a handle, numbers typed."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.errors import FfdError

POINT_HINT = "x, y, z of a point of the undeformed model"

Pair = tuple[float, float]


def turn_matrix(wxyz: Floats) -> Floats:
    """Rotation matrix (3, 3) of a unit quaternion (4,), scalar first."""
    w, x, y, z = wxyz / np.linalg.norm(wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def turn_quaternion(matrix: Floats) -> Floats:
    """Unit quaternion (4,), scalar first, of a rotation matrix (3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(matrix).as_quat(scalar_first=True))


def turn_about_axis(matrix: Floats) -> tuple[int, float]:
    """Axis (0, 1 or 2) and angle in degrees of a rotation about one of three axes.

    The axis is that whose unit vector moves least.
    """
    axis = int(np.argmax(np.diag(matrix)))
    second, third = (axis + 1) % 3, (axis + 2) % 3
    angle = np.arctan2(
        matrix[third, second] - matrix[second, third], matrix[second, second] + matrix[third, third]
    )
    return axis, float(np.degrees(angle))


def inside_rectangle(
    points: Floats,
    low: Pair,
    high: Pair,
    *,
    position: Floats,
    wxyz: Floats,
    fov: float,
    aspect: float,
) -> Bools:
    """Which points (n, 3) a perspective camera shows in a rectangle.

    Parameters
    ----------
    points : (n, 3) float64, model length
    low, high : pair of float
        Corners of the rectangle. (0, 0) is the upper left corner of the picture, (1, 1) the lower
        right one.
    position : (3,) float64
        Of the camera.
    wxyz : (4,) float64
        Its orientation: it looks along its z axis, and its y axis points down.
    fov : float
        Angle of view from top to bottom, radians.
    aspect : float
        Width of the picture over its height.
    """
    seen = (points - position) @ turn_matrix(wxyz)
    depth = seen[:, 2]
    ahead = depth > 0
    scale = 2 * np.tan(fov / 2) * np.where(ahead, depth, 1.0)
    across, down = seen[:, 0] / (scale * aspect) + 0.5, seen[:, 1] / scale + 0.5
    return ahead & (low[0] <= across) & (across <= high[0]) & (low[1] <= down) & (down <= high[1])


def numbers(text: str, count: int, name: str) -> list[float]:
    """Numbers that are typed into a field, separated by commas or spaces.

    Raises
    ------
    FfdError
        There are not that many, or one is no number.
    """
    words = text.replace(",", " ").split()
    try:
        found = [float(word) for word in words]
    except ValueError:
        found = []
    if len(found) != count or not np.isfinite(found).all():
        form = "one number" if count == 1 else f"{count} numbers, such as 1.5, 0, -2"
        raise FfdError(f"{name}: {text!r} is not {form}")
    return found


def number_text(values: object) -> str:
    """Numbers as they are typed: the shortest text of each."""
    return ", ".join(f"{float(value):.12g}" for value in np.atleast_1d(np.asarray(values)))
