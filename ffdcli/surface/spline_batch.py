"""Splines of one pattern as functions of control nets: what batches of patches and edges share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.splines.composition import in_parts
from ffdcli.splines.joints import Joint, plan_joint
from ffdcli.splines.local_sums import LocalSums, collect_sums
from ffdcli.volume.net_kind import NetKind
from ffdcli.volume.protocol import Restriction, Volume


@dataclass(frozen=True, kw_only=True)
class SplineBatch(ABC):
    """Splines (m,) of one or two parameters in one box that share degrees and multiplicities.

    Parameters
    ----------
    zone : int
        Index of the volume.
    degrees : tuple of int
        Along each parameter.
    breaks : tuple of (m, J + 1) float64
        Ends of the domain and breaks between them, along each parameter.
    mults : tuple of (J - 1,) int64
        Multiplicities of the breaks between the ends.
    joints : tuple of Joint
        Sums of Bézier points of pieces that give control points, along each parameter.
    restriction : Restriction
        Bézier form of the volume on the boxes of all ``m prod(J)`` pieces, spline by spline.
    ends : (m prod(J), 2, ..., 3) float64
        Undeformed points at the corners of the pieces.
    net_kind : NetKind
        What the control net of the volume stands for.
    sums : LocalSums or None
        Matrices from the net to all control points; see :meth:`with_matrices`.
    """

    zone: int
    degrees: tuple[int, ...]
    breaks: tuple[Floats, ...]
    mults: tuple[Ints, ...]
    joints: tuple[Joint, ...]
    restriction: Restriction
    ends: Floats
    net_kind: NetKind
    sums: LocalSums | None = None

    @property
    def count(self) -> int:
        """Number of splines."""
        return len(self.breaks[0])

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of pieces along each parameter."""
        return tuple(breaks.shape[1] - 1 for breaks in self.breaks)

    @property
    def boxes_each(self) -> int:
        """Number of boxes of the restriction that each spline has: its pieces."""
        return int(np.prod(self.shape))

    @property
    def pole_counts(self) -> tuple[int, ...]:
        """Number of control points of each spline along each parameter."""
        return tuple(joint.piece.shape[1] for joint in self.joints)

    @property
    def full_mults(self) -> list[Ints]:
        """Multiplicities of all breaks along each parameter, the ends included."""
        pairs = zip(self.degrees, self.mults, strict=True)
        return [np.concatenate([[d + 1], mults, [d + 1]]) for d, mults in pairs]

    def control_points(self, net: Floats, chosen: Ints) -> Floats:
        """Control points of chosen splines for a control net.

        Parameters
        ----------
        net : (..., c) float64
            Of the volume.
        chosen : (p,) int64
            Indices into the batch.

        Returns
        -------
        (p, n, ..., 3 or 4) float64
            The composition of Feng 2002, section 3.4, in product form; homogeneous where the
            deformation is rational.
        """
        if self.sums is not None:
            return self.sums.apply(net).reshape(self.count, *self.pole_counts, -1)[chosen]
        return self._evaluate(net, chosen, self.net_kind.complete)

    def weights(self, net: Floats, chosen: Ints) -> Floats:
        """Weights (p, n, ..., 1) of :meth:`control_points`."""
        complete = self.net_kind.complete_weights
        weights = self.net_kind.weight_part(net)
        return self._evaluate(weights, chosen, lambda forms, ends: complete(forms))

    def with_matrices(self) -> Self:
        """The batch with its sums; the same batch where the volume is no tensor product."""
        restriction = self.restriction.as_tensor
        if restriction is None:
            return self
        # The piece of each control point, and the first box of that piece.
        pieces = np.arange(self.count)[:, None]
        for joint, count in zip(self.joints, self.shape, strict=True):
            pieces = pieces[:, :, None] * count + joint.piece[:, None, :]
            pieces = pieces.reshape(self.count, -1)
        boxes = pieces * (self.boxes_each // int(np.prod(self.shape)))
        number = np.arange(pieces.size).reshape(pieces.shape)
        # A row of weights takes as much memory as this many points.
        room = int(np.prod([k + 1 for k in restriction.degrees])) // 3 + 1

        def rows() -> Iterator[tuple[Ints, Floats]]:
            for part in in_parts(np.arange(self.count), self.boxes_each * room):
                index = self._boxes_of(part)
                found = self._join(self._compose(restriction.matrices(index), index), part)
                yield number[part].ravel(), found.reshape(-1, found.shape[-1])

        sums = collect_sums(restriction.degrees, restriction.first, boxes.ravel(), rows())
        return replace(self, sums=sums)

    def _evaluate(
        self, net: Floats, chosen: Ints, complete: Callable[[Floats, Floats], Floats]
    ) -> Floats:
        """Joined forms of the net on the pieces of chosen splines, each completed first."""
        out = []
        for part in in_parts(chosen, self.boxes_each):
            index = self._boxes_of(part)
            forms = self._compose(self.restriction.apply(net, index), index)
            out.append(self._join(complete(forms, self.ends[index]), part))
        return np.concatenate(out)

    def _boxes_of(self, chosen: Ints) -> Ints:
        """Numbers of the boxes of splines, spline by spline."""
        count = self.boxes_each
        return np.asarray((chosen[:, None] * count + np.arange(count)[None, :]).ravel())

    @abstractmethod
    def _compose(self, points: Floats, index: Ints) -> Floats:
        """Forms (n, p, ..., c) on boxes (n,) from Bézier points (n, ., ., ., c) of the volume."""

    def _join(self, forms: Floats, chosen: Ints) -> Floats:
        """Control points of chosen splines from the forms on their boxes."""
        count = len(self.shape)
        grid = forms.reshape(len(chosen), *self.shape, *forms.shape[1:])
        order = [axis for i in range(1, count + 1) for axis in (i, count + i)]
        grid = grid.transpose(0, *order, 2 * count + 1)
        # Axes: spline, pieces and points of each parameter left to join, joined points, component.
        for joint in self.joints:
            rest = grid.shape[3:]
            joined = joint.apply(grid.reshape(*grid.shape[:3], int(np.prod(rest))), chosen)
            grid = np.moveaxis(joined.reshape(*joined.shape[:2], *rest), 1, -2)
        return np.ascontiguousarray(grid)


@dataclass(frozen=True, kw_only=True)
class SurfaceBatch(SplineBatch):
    """Surfaces of patches.

    Parameters
    ----------
    patches : (m,) int64
        Their numbers in the partition.
    cells : (m Js Jt, 3) int64
        Polynomial cell of the volume on each piece.
    """

    patches: Ints
    cells: Ints

    @abstractmethod
    def rounding(self, volume: Volume) -> float:
        """Bound of the rounding error that counts beside that of the kernel, model length."""


def plan_joints(
    breaks: Sequence[Floats], mults: Sequence[Ints], degrees: Sequence[int]
) -> tuple[Joint, ...]:
    """The joints of splines along each parameter."""
    return tuple(map(plan_joint, breaks, mults, degrees))
