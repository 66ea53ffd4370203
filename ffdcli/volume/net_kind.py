"""Kinds of control nets: how the polynomials of a net become the deformation.

Later stages restrict and compose the polynomials of a net, whatever its kind. The kind then
completes the resulting forms, in any number of variables, to points or homogeneous points. With
``x`` the undeformed point and ``N, W`` the weighted sums of vectors and of weights:

===========  ==========  ====================================  ==================
kind         components  deformation                           degree of the form
===========  ==========  ====================================  ==================
direct       3           ``N``                                 d
direct       4           ``N / W``                             d
displaced    3           ``x + N``                             max(d, 1)
displaced    4           ``x + N / W``                         d + 1
displaced    8           ``x + N / W - N0 / W0``               2 d + 1
===========  ==========  ====================================  ==================
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.splines.polynomials import multiply, raise_degrees

# Control points within this many units in the last place of each other count as equal.
_EQUAL_ULPS = 64.0


@dataclass(frozen=True)
class NetKind:
    """Conversion of forms of a net into the deformation.

    Parameters
    ----------
    displaces : bool
        True where the net gives displacements, False where it gives images.
    components : int
        Components of the net: 3, 4 or 8; see the table above.
    """

    displaces: bool
    components: int

    @property
    def rational(self) -> bool:
        """Whether the deformation is a quotient."""
        return self.components > 3

    def degree(self, degree: int) -> int:
        """Degree of a completed form of the net's degree."""
        if not self.displaces:
            return degree
        if self.components == 3:
            return max(degree, 1)
        return 2 * degree + 1 if self.components == 8 else degree + 1

    def weight_part(self, net: Floats) -> Floats:
        """Components of a net (..., c) that the weights depend on."""
        return net[..., [3, 7]] if self.components == 8 else net[..., 3:]

    def complete_weights(self, forms: Floats) -> Floats:
        """Weights of completed forms, from those of :meth:`weight_part`, last axis 1."""
        if not self.displaces:
            return forms
        if self.components == 8:
            forms = multiply(forms[..., :1], forms[..., 1:])
        return raise_degrees(forms, [n for n in forms.shape[1:-1]])

    def complete(self, forms: Floats, ends: Floats) -> Floats:
        """Points, or homogeneous points, of the deformation from forms of the net.

        Parameters
        ----------
        forms : (m, p + 1, ..., c) float64
            Bernstein forms of the net, in any number of variables.
        ends : (m, 2, ..., 3) float64
            The undeformed point where each variable is 0 or 1; it is multilinear in between.

        Returns
        -------
        (m, ..., 3 or 4) float64
            The degree in each variable is given by :meth:`degree`.
        """
        if not self.displaces:
            return forms
        inner = forms.shape[1:-1]
        if self.components == 3:
            raised = [max(n - 1, 1) for n in inner]
            return raise_degrees(forms, raised) + raise_degrees(ends, raised)
        vectors, weights = forms[..., :3], forms[..., 3:4]
        if self.components == 8:
            base = forms[..., 7:8]
            vectors = multiply(vectors, base) - multiply(forms[..., 4:7], weights)
            weights = multiply(weights, base)
        raised = [n for n in weights.shape[1:-1]]
        whole = multiply(weights, ends) + raise_degrees(vectors, raised)
        return np.concatenate([whole, raise_degrees(weights, raised)], axis=-1)

    def images(self, values: Floats, places: Floats) -> Floats:
        """Images (m, 3) of points (m, 3) from values (m, c) of the net there."""
        if self.components == 3:
            return places + values if self.displaces else values
        moved = values[:, :3] / values[:, 3:4]
        if not self.displaces:
            return moved
        if self.components == 8:
            moved = moved - values[:, 4:7] / values[:, 7:]
        return places + moved

    def slopes(self, values: Floats, slopes: Floats) -> Floats:
        """Derivatives (m, 3, 3) of images from values (m, c) and slopes (m, c, 3) of the net."""
        if self.components == 3:
            return slopes + np.eye(3) if self.displaces else slopes
        out = _quotient_slope(values[:, :4], slopes[:, :4])
        if self.components == 8:
            out = out - _quotient_slope(values[:, 4:], slopes[:, 4:])
        return out + np.eye(3) if self.displaces else out

    def plain(self, points: Floats) -> tuple[Floats, Bools]:
        """Bézier points (m, ..., 3) of the displacement or image, where that is a polynomial.

        Parameters
        ----------
        points : (m, ..., c) float64
            Bézier points of the net.

        Returns
        -------
        (m, ..., 3) float64, (m,) bool
            True where the deformation is the polynomial with these points: where all weights are
            equal, or all displacements.
        """
        if self.components == 3:
            return points, np.ones(len(points), dtype=bool)
        weights = points[..., 3]
        if self.components == 8:
            # Where both weights are equal the quotients have one denominator.
            same = _all_equal(np.stack([weights, points[..., 7]], axis=-1), axis=-1)
            vectors = points[..., :3] - points[..., 4:7]
            divided = vectors / weights[..., None]
            alike = same.reshape(len(points), -1).all(axis=1)
        else:
            divided = points[..., :3] / weights[..., None]
            alike = np.ones(len(points), dtype=bool)
        flat = weights.reshape(len(points), -1)
        equal = _all_equal(flat, axis=1)
        if self.displaces:
            moved = divided.reshape(len(points), -1, 3)
            spread = np.ptp(moved, axis=1).max(axis=1)
            equal |= spread <= _EQUAL_ULPS * np.finfo(float).eps * np.abs(moved).max(axis=(1, 2))
        return divided, equal & alike


DIRECT = NetKind(displaces=False, components=3)


def _quotient_slope(values: Floats, slopes: Floats) -> Floats:
    image = values[:, :3] / values[:, 3:]
    out = slopes[:, :3] - image[:, :, None] * slopes[:, 3:]
    return np.asarray(out / values[:, 3:, None])


def _all_equal(values: Floats, axis: int) -> Bools:
    spread = np.ptp(values, axis=axis)
    return np.asarray(spread <= _EQUAL_ULPS * np.finfo(float).eps * np.abs(values).max(axis=axis))
