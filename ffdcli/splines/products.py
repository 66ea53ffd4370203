"""Products of Bernstein forms, and forms of higher degree."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.splines.polynomials import binomials


def multiply(first: Floats, second: Floats) -> Floats:
    """Products of forms, degrees added variable by variable.

    Parameters
    ----------
    first, second : (m, p + 1, ..., c), (m, q + 1, ..., c) float64
        In the same number of variables; the last axes broadcast.
    """
    a, b = _scaled(first, 1), _scaled(second, 1)
    if np.prod(b.shape[1:-1]) > np.prod(a.shape[1:-1]):
        a, b = b, a
    inner = tuple(p + q - 1 for p, q in zip(a.shape[1:-1], b.shape[1:-1], strict=True))
    out = np.zeros((a.shape[0], *inner, max(a.shape[-1], b.shape[-1])))
    for index in np.ndindex(b.shape[1:-1]):
        window = tuple(slice(i, i + n) for i, n in zip(index, a.shape[1:-1], strict=True))
        factor = b[(slice(None), *index)].reshape(len(b), *(1,) * len(inner), b.shape[-1])
        out[(slice(None), *window)] += a * factor
    return _scaled(out, -1)


def raise_degrees(forms: Floats, degrees: Sequence[int]) -> Floats:
    """The same forms (m, p + 1, ..., c) written with given degrees, at least their own."""
    out = forms
    for variable, degree in enumerate(degrees):
        axis = 1 + variable
        if out.shape[axis] != degree + 1:
            raised = np.tensordot(_elevation(out.shape[axis] - 1, degree), out, axes=(1, axis))
            out = np.moveaxis(raised, 0, axis)
    return out


@lru_cache(maxsize=64)
def _elevation(degree: int, raised: int) -> Floats:
    """(raised + 1, degree + 1) matrix that writes a form of a degree with a higher one."""
    more = raised - degree
    out = np.zeros((raised + 1, degree + 1))
    for i in range(degree + 1):
        out[i : i + more + 1, i] = binomials(degree)[i] * binomials(more)
    return np.asarray(out / binomials(raised)[:, None])


def _scaled(forms: Floats, power: int) -> Floats:
    """Forms with their coefficients times, or divided by, the binomials of every variable."""
    out = forms
    for axis in range(1, forms.ndim - 1):
        row = binomials(forms.shape[axis] - 1) ** float(power)
        out = out * row.reshape(-1, *(1,) * (forms.ndim - 1 - axis))
    return out
