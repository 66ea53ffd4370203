"""Arithmetic of many polynomials in Bernstein form: products, derivatives, halves, values.

A form of degrees ``(n_1, ..., n_d)`` on the unit cube is an array ``(n_1 + 1, ..., n_d + 1, m)``:
the last axis counts the boxes, which keeps the inner loops long. Forms with components, ``(m, n_1 +
1, ..., n_d + 1, c)``, have the boxes first: those of :func:`multiply` and :func:`raise_degrees`.
*Scaled* forms are multiplied by their binomial factors; their product is a convolution.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import comb

import numpy as np

from ffdcli.arrays import Floats


@lru_cache(maxsize=64)
def binomials(degree: int) -> Floats:
    """(degree + 1,) binomial coefficients C(degree, i)."""
    row = np.array([comb(degree, i) for i in range(degree + 1)], dtype=np.float64)
    row.flags.writeable = False
    return row


def bernstein(degree: int, places: Floats) -> Floats:
    """Values (..., degree + 1) of the Bernstein polynomials at parameters (...)."""
    index = np.arange(degree + 1)
    at = places[..., None]
    return np.asarray(binomials(degree) * at**index * (1 - at) ** (degree - index))


@lru_cache(maxsize=256)
def elevation(degree: int, raised: int) -> Floats:
    """(raised + 1, degree + 1) matrix from coefficients to those of the same form, raised."""
    more = raised - degree
    out = np.zeros((raised + 1, degree + 1))
    for i in range(degree + 1):
        out[i : i + more + 1, i] = binomials(degree)[i] * binomials(more)
    out /= binomials(raised)[:, None]
    out.flags.writeable = False
    return out


def scale(forms: Floats) -> Floats:
    """Coefficients (n_1 + 1, ..., n_d + 1, m) times their binomial factors."""
    return forms * _factors(forms.shape[:-1])


def unscale(forms: Floats) -> Floats:
    """The inverse of :func:`scale`."""
    return forms / _factors(forms.shape[:-1])


def derivative(forms: Floats, axis: int) -> Floats:
    """Derivative along one variable of the unit cube; the degree falls by one."""
    return np.diff(forms, axis=axis) * (forms.shape[axis] - 1)


def raise_degree(forms: Floats, axis: int) -> Floats:
    """The same scaled form with its degree along one variable raised by one."""
    none = np.zeros((*forms.shape[:axis], 1, *forms.shape[axis + 1 :]))
    return np.concatenate([forms, none], axis=axis) + np.concatenate([none, forms], axis=axis)


def raise_degrees(forms: Floats, degrees: Sequence[int]) -> Floats:
    """The same forms (m, n_1 + 1, ..., c) with the given degrees, at least their own."""
    out = forms
    for axis, degree in enumerate(degrees, start=1):
        if out.shape[axis] != degree + 1:
            raised = np.tensordot(elevation(out.shape[axis] - 1, degree), out, axes=(1, axis))
            out = np.moveaxis(raised, 0, axis)
    return out


def add_product(
    out: Floats, left: Floats, right: Floats, sign: int, variables: int | None = None
) -> None:
    """Add ``sign`` times the product of two scaled forms to a scaled form in place.

    Parameters
    ----------
    out, left, right : (n_1 + 1, ..., n_d + 1, ...) float64
        The axes after the variables broadcast.
    sign : {1, -1}
    variables : int, optional
        Number d of variables; all axes but the last by default.
    """
    d = left.ndim - 1 if variables is None else variables
    if np.prod(left.shape[:d]) > np.prod(right.shape[:d]):
        left, right = right, left
    for index in np.ndindex(left.shape[:d]):
        place = tuple(slice(i, i + n) for i, n in zip(index, right.shape[:d], strict=True))
        if sign > 0:
            out[place] += left[index] * right
        else:
            out[place] -= left[index] * right


def multiply(first: Floats, second: Floats) -> Floats:
    """Products of forms; the degrees add up variable by variable.

    Parameters
    ----------
    first, second : (m, p_1 + 1, ..., c), (m, q_1 + 1, ..., c) float64
        Forms in the same number of variables; the last axes broadcast.
    """
    # With the boxes last in memory too, the inner loops are long.
    a, b = (
        np.ascontiguousarray(np.moveaxis(_scaled(forms, 1), 0, -1)) for forms in (first, second)
    )
    inner = tuple(p + q - 1 for p, q in zip(a.shape[:-2], b.shape[:-2], strict=True))
    out = np.zeros((*inner, max(a.shape[-2], b.shape[-2]), a.shape[-1]))
    add_product(out, b, a, 1, variables=len(inner))
    return _scaled(np.ascontiguousarray(np.moveaxis(out, -1, 0)), -1)


def halve(forms: Floats, axis: int) -> tuple[Floats, Floats]:
    """The forms on the lower and the upper half of one variable (de Casteljau at the middle)."""
    degree = forms.shape[axis] - 1
    moved = np.moveaxis(forms, axis, 0)
    flat = moved.reshape(degree + 1, -1)
    lower, upper = (
        np.moveaxis((weights @ flat).reshape(moved.shape), 0, axis) for weights in _halving(degree)
    )
    return lower, upper


def values_at(forms: Floats, shares: Floats) -> Floats:
    """(m,) value of each form at its own point (m, d) of the unit cube."""
    for t in shares.T:
        degree = len(forms) - 1
        powers = np.arange(degree + 1)[:, None]
        basis = binomials(degree)[:, None] * t**powers * (1 - t) ** (degree - powers)
        forms = np.einsum("im,i...m->...m", basis, forms)
    return forms


def _factors(shape: tuple[int, ...]) -> Floats:
    """Products of binomials, with a last axis of length one."""
    out = np.ones(1)
    for count in reversed(shape):
        out = np.multiply.outer(binomials(count - 1), out)
    return out


def _scaled(forms: Floats, power: int) -> Floats:
    """Forms (m, n_1 + 1, ..., c) times a power of the binomials of every variable."""
    out = forms
    for axis in range(1, forms.ndim - 1):
        row = binomials(forms.shape[axis] - 1) ** float(power)
        out = out * row.reshape(-1, *(1,) * (forms.ndim - 1 - axis))
    return out


@lru_cache(maxsize=64)
def _halving(degree: int) -> tuple[Floats, Floats]:
    """Matrices to the coefficients on [0, 1/2] and on [1/2, 1]; their entries are dyadic."""
    lower = np.zeros((degree + 1, degree + 1))
    for i in range(degree + 1):
        lower[i, : i + 1] = binomials(i) / 2.0**i
    return lower, np.ascontiguousarray(lower[::-1, ::-1])
