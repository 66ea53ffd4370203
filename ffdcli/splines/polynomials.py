"""Arithmetic of many Bernstein forms at once: products, derivatives, halves, values.

A form of degrees ``(n_1, ..., n_d)`` on the unit cube is an array ``(n_1 + 1, ..., n_d + 1, m)``:
the last axis counts the boxes, which keeps the inner loops long. Products are taken of *scaled*
forms, whose coefficients carry their binomial factors: there a product is a convolution.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.special import comb

from ffdcli.arrays import Floats


@lru_cache(maxsize=64)
def binomials(degree: int) -> Floats:
    """(degree + 1,) binomial coefficients C(degree, i)."""
    row = comb(degree, np.arange(degree + 1))
    row.flags.writeable = False
    return row


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


def add_product(out: Floats, left: Floats, right: Floats, sign: int) -> None:
    """Add ``sign`` times the product of two scaled forms to a scaled form in place."""
    if left.size > right.size:
        left, right = right, left
    for index in np.ndindex(left.shape[:-1]):
        place = tuple(slice(i, i + n) for i, n in zip(index, right.shape[:-1], strict=True))
        if sign > 0:
            out[place] += left[index] * right
        else:
            out[place] -= left[index] * right


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
    """(m,) each form at its own point (m, d) of the unit cube."""
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


@lru_cache(maxsize=64)
def _halving(degree: int) -> tuple[Floats, Floats]:
    """Matrices to the coefficients on [0, 1/2] and on [1/2, 1]; their entries are dyadic."""
    lower = np.zeros((degree + 1, degree + 1))
    for i in range(degree + 1):
        lower[i, : i + 1] = binomials(i) / 2.0**i
    return lower, np.ascontiguousarray(lower[::-1, ::-1])
