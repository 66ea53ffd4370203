"""Two sufficient conditions for global injectivity of a locally injective deformation.

*Monotone map.* On a convex set, ``(y - x)·M(D(y) - D(x))`` is the integral of ``d·M J d`` along
the segment, ``d = y - x``. If the symmetric part of ``M J`` is positive definite for one matrix M,
no two points have the same image. The symmetric part is a mean of its Bernstein coefficients, which
are matrices; so it is positive definite where they are.

*Fixed boundary.* If the boundary of the lattice box is fixed and det J > 0 in the whole box, the
map continued by the identity is a proper local homeomorphism of space, hence injective (Hadamard;
Meisters and Olech 1963 for balls).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.folds.certificate import certify
from ffdcli.folds.determinant import cell_forms, find_cells
from ffdcli.folds.domain import WholeBox
from ffdcli.splines.polynomials import add_product, derivative, halve, raise_degree, scale, unscale
from ffdcli.volume.protocol import Volume

_EPS = float(np.finfo(float).eps)
# Upper bound of the number of roundings in a coefficient of a derivative, each relative to the
# largest product in it.
_ROUNDINGS = 4096
# Halvings, and boxes treated together, after which the condition counts as not proved.
_ROUNDS = 6
_MOST_BOXES = 3_000
# Factor by which the matrix for a shear is stretched beyond the least stretch that it needs.
_STRETCH = 1.5


def is_monotone(volume: Volume, bounds: Floats, *, reaches_out: bool) -> bool:
    """Prove by the first condition that no two points of a box have the same image.

    Parameters
    ----------
    volume : Volume
    bounds : (2, 3) float64, lattice frame
        A box around the model, within the lattice box.
    reaches_out : bool
        True where the model extends beyond the lattice box, where D is the identity; then M must
        satisfy the condition for the identity too. D must be continuous on the convex hull of the
        model.

    Returns
    -------
    bool
        False where nothing is proved.
    """
    cells = find_cells(volume, bounds[0], bounds[1])
    fixed = volume.is_identity(cells)
    if fixed.all():
        return True
    # Cells at rest ask of M what the identity outside the box asks.
    cells, reaches_out = cells[~fixed], reaches_out or bool(fixed.any())
    if len(cells) > _MOST_BOXES:
        return False
    box = volume.cell_bounds(cells)
    slopes, slack = _slopes(volume, cells)
    return any(
        _is_definite_on(matrix, slopes, slack, box, bounds)
        for matrix in _matrices(slopes, reaches_out)
    )


def keeps_boundary(volume: Volume) -> bool:
    """Prove by the second condition that no two points of space have the same image.

    Returns
    -------
    bool
        False where nothing is proved.
    """
    if not _boundary_rests(volume):
        return False
    return certify(volume, WholeBox(volume.box), may_mirror=False).locally_injective == "yes"


def _slopes(volume: Volume, cells: Ints) -> tuple[Floats, Floats]:
    """Positive multiples of J as Bernstein forms (3, 3, ..., m), and rounding bounds (m,).

    J itself where weights are 1, else ``W^2 J = W X' - X W'``; entry [i, j] stands for
    ``dD_i / du_j``.
    """
    forms, rounding = cell_forms(volume, cells, (volume.net,))
    bounds = volume.cell_bounds(cells)
    widths = (bounds[:, 1] - bounds[:, 0]).T
    columns = []
    for axis, width in enumerate(widths):
        slope = derivative(forms, axis + 1) / width
        if len(forms) == 4:
            column = [_quotient_slope(forms, slope, i) for i in (1, 2, 3)]
        else:
            column = [scale(form) for form in slope]
        columns.append([unscale(raise_degree(form, axis)) for form in column])
    slopes = np.stack([np.stack(column) for column in columns], axis=1)
    largest = np.abs(forms).max() if len(forms) == 4 else 1.0
    degree = max(volume.degrees)
    error = 8 * degree * largest * (rounding.max() + _ROUNDINGS * _EPS * np.abs(forms).max())
    return slopes, error / widths.min(axis=0)


def _quotient_slope(forms: Floats, slope: Floats, row: int) -> Floats:
    """The scaled form of ``W X' - X W'``."""
    shape = tuple(a + b - 1 for a, b in zip(forms.shape[1:-1], slope.shape[1:-1], strict=True))
    out = np.zeros((*shape, forms.shape[-1]))
    add_product(out, scale(forms[0]), scale(slope[row]), 1)
    add_product(out, scale(forms[row]), scale(slope[0]), -1)
    return out


def _matrices(slopes: Floats, reaches_out: bool) -> Iterator[Floats]:
    """Candidate matrices M: the inverse of the mean derivative, and the same stretched for a shear.

    For ``J = I + n f^T``, with all displacements along n, ``M = A (I - n n^T) + n n^T`` satisfies
    the condition where ``4 A (1 + f·n) > |f - (f·n) n|^2``.
    """
    mean = slopes.mean(axis=tuple(range(2, slopes.ndim)))
    means = [mean]
    if reaches_out:
        means = [np.eye(3), mean / max(np.trace(mean) / 3, 1e-300) + np.eye(3)]
    for middle in means:
        if np.linalg.cond(middle) > 1e6:
            continue
        undo = np.linalg.inv(middle)
        if reaches_out and np.linalg.eigvalsh(undo + undo.T)[0] <= 1e-9:
            continue
        yield undo
        rest = np.tensordot(undo, slopes, axes=1).reshape(3, 3, -1) - np.eye(3)[:, :, None]
        flat = rest.reshape(3, -1)
        normal = np.linalg.eigh(flat @ flat.T)[1][:, 2]
        along = np.tensordot(normal, rest, axes=1)
        rise = 1 + normal @ along
        across = np.sum((along - np.outer(normal, rise - 1)) ** 2, axis=0)
        if np.all(rise > 0):
            stretch = max(1.0, _STRETCH * float((across / (4 * rise)).max()))
            projector = np.outer(normal, normal)
            matrix = (stretch * (np.eye(3) - projector) + projector) @ undo
            if not reaches_out or np.linalg.eigvalsh(matrix + matrix.T)[0] > 1e-9:
                yield matrix


def _is_definite_on(
    matrix: Floats, slopes: Floats, slack: Floats, box: Floats, bounds: Floats
) -> bool:
    """Whether ``x·M J x > 0`` over ``bounds`` for all x; undecided boxes are halved."""
    turned = np.tensordot(matrix, slopes, axes=1)
    forms = turned + turned.swapaxes(0, 1)
    slack = 2 * 3 * np.abs(matrix).max() * slack + 64 * _EPS * np.abs(matrix).max() * np.abs(
        slopes
    ).max(axis=tuple(range(slopes.ndim - 1)))
    for step in range(_ROUNDS + 1):
        definite = _is_definite(forms, slack)
        doubtful = ~definite.all(axis=tuple(range(definite.ndim - 1)))
        doubtful &= np.all((box[:, 0] <= bounds[1]) & (box[:, 1] >= bounds[0]), axis=1)
        if not doubtful.any():
            return True
        inside = np.all((box[:, 0] >= bounds[0]) & (box[:, 1] <= bounds[1]), axis=1)
        corners = definite[:: definite.shape[0] - 1, :: definite.shape[1] - 1]
        corners = corners[:, :, :: definite.shape[2] - 1]
        if not corners[..., inside].all() or step == _ROUNDS:
            return False
        if np.count_nonzero(doubtful) > _MOST_BOXES:
            return False
        forms, slack, box = forms[..., doubtful], slack[doubtful], box[doubtful]
        axis = step % 3
        middle = box.mean(axis=1)[:, axis]
        low, high = box.copy(), box.copy()
        low[:, 1, axis], high[:, 0, axis] = middle, middle
        slack = slack + 64 * _EPS * np.abs(forms).max(axis=tuple(range(forms.ndim - 1)))
        forms = np.concatenate(halve(forms, axis + 2), axis=-1)
        slack, box = np.tile(slack, 2), np.concatenate([low, high])
    return False


def _is_definite(forms: Floats, slack: Floats) -> Bools:
    """(..., m) True for symmetric matrices (3, 3, ..., m) positive definite beyond rounding.

    By Sylvester's criterion, for the matrices with the slack subtracted from their diagonals.
    """
    (a, d, e), (_, b, f), (_, _, c) = forms
    a, b, c = a - 3 * slack, b - 3 * slack, c - 3 * slack
    minor = a * b - d * d
    whole = minor * c - a * f * f - b * e * e + 2 * d * e * f
    rounding = 64 * _EPS * np.abs(forms).max(axis=(0, 1))
    scale_ = np.abs(forms).max(axis=(0, 1))
    return np.asarray((a > 0) & (minor > rounding * scale_) & (whole > rounding * scale_**2))


def _boundary_rests(volume: Volume) -> bool:
    """Whether D is the identity, to rounding, on all six sides of the lattice box."""
    for side in range(2):
        for axis in range(3):
            wall = volume.box.copy()
            wall[:, axis] = volume.box[side, axis]
            cells = find_cells(volume, wall[0], wall[1])
            forms, rounding = cell_forms(volume, cells, (volume.net,))
            forms = forms.take([-side], axis=axis + 1)
            if len(forms) == 4:
                weight = forms[0]
                if np.ptp(weight) > 2 * rounding[0]:
                    return False
                forms, rounding = forms[1:] / weight, rounding[1:] / weight.min()
            bounds = volume.cell_bounds(cells)
            for row in range(3):
                low, high = bounds[:, 0, row], bounds[:, 1, row]
                count = forms.shape[row + 1]
                shares = np.full(1, float(side)) if row == axis else np.linspace(0, 1, count)
                rest = low + shares[:, None] * (high - low)
                shape = [1, 1, 1, len(cells)]
                shape[row] = count
                if np.any(np.abs(forms[row] - rest.reshape(shape)) > 4 * rounding[row]):
                    return False
    return True
