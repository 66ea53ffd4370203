"""The deformed part and the file side by side: what corresponds, and how far it is apart."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.bspline import sums
from ffdcli.verify.part.match import in_order, same_parameters
from ffdcli.verify.part.reasons import Found
from ffdcli.verify.part.search import Target, measure
from ffdcli.verify.part.shape import DeformedShape
from ffdcli.verify.part.spots import Spots, face_spots, line_spots

# Distance of middles of edges, as a share of the largest coordinate, up to which edges of the same
# neighbours are the same.
_SAME_PLACE = 1e-2


@dataclass(frozen=True, eq=False)
class Pair:
    """The deformed part and the file, with what corresponds in them.

    Parameters
    ----------
    part, file : DeformedShape
        That of the file under the identity.
    samples : int
    settle, tolerance : float, model length
    """

    part: DeformedShape
    file: DeformedShape
    samples: int
    settle: float
    tolerance: float

    @cached_property
    def ordered(self) -> bool:
        """Whether faces and lines correspond by number; otherwise any may be the right one.

        Neighbours alone cannot tell the two edges of a torus apart, but their places can.
        """
        if not in_order(self.part, self.file):
            return False
        owner, here, there = self.edge_places
        count = np.maximum(np.bincount(owner), 1)[:, None]
        apart = np.linalg.norm(sums(owner, here - there, len(count)) / count, axis=1)
        return bool(np.all(apart <= _SAME_PLACE * np.abs(here).max(initial=0.0)))

    @cached_property
    def edge_places(self) -> tuple[Ints, Floats, Floats]:
        """Edges (n,), and their positions (n, 3) in both at the same shares of their ranges."""
        spots = self.lines[0]
        spots = spots.take(np.flatnonzero(spots.owner < len(self.part.shape.edges)))
        shares = Target.lines(self.part, spots).shares(spots.owner, spots.params)
        at = Target.lines(self.file, spots).at_shares(spots.owner, shares)
        return spots.owner, spots.position, self.file.on_lines(spots.owner, at)[0]

    @cached_property
    def kept(self) -> tuple[Bools, Bools]:
        """Faces (F,), and lines (E + C,), that have the same parameters in both.

        Pcurves may be the same where a circle and its plane have become rational: then the curves
        of the edges tell that the parameters are others.
        """
        part = self.part.shape
        pcurves, faces = same_parameters(part, self.file.shape)
        edges, (owner, here, there) = len(part.edges), self.edge_places
        gap = np.linalg.norm(there - here, axis=1)
        beyond = np.bincount(owner, gap > self.tolerance, minlength=edges)
        others = 2 * beyond > np.bincount(owner, minlength=edges)
        faces[part.coedge_face[others[part.coedge_edge]]] = False
        pcurves &= ~others[part.coedge_edge]
        # Only their nearest distances count for the curves of edges.
        return faces, np.concatenate([np.zeros(edges, dtype=bool), pcurves])

    @cached_property
    def slack(self) -> Floats:
        """(E + C,) what lines of the file may be off in addition, model length.

        STEP and IGES readers approximate some curves in surface parameters anew, within the edge's
        tolerance; twice the tolerance allowed at most.
        """
        shape = self.file.shape
        known = np.minimum(shape.edge_tolerance, 2 * self.tolerance)[shape.coedge_edge]
        if self.ordered:
            known = np.where(self.kept[1][len(shape.edges) :], 0.0, known)
        return np.concatenate([np.zeros(len(shape.edges)), known])

    @cached_property
    def loose_ends(self) -> Floats:
        """(E + C, 2) how far the vertices of the part are from the ends of its lines."""
        image = self.part
        edge = np.concatenate([np.arange(len(image.shape.edges)), image.shape.coedge_edge])
        ends = np.array([each[[0, -1]] for each in image.line_breaks]).reshape(-1, 2)
        out = np.zeros(ends.shape)
        for side in (0, 1):
            vertex = image.shape.edges[edge, side]
            known = np.flatnonzero(image.line_there & (vertex >= 0))
            place, _ = image.on_lines(known, ends[known, side : side + 1])
            out[known, side] = np.linalg.norm(place - image.points[vertex[known]], axis=1)
        return out

    def cut(self, spots: Spots) -> Floats:
        """(n,) what spots on lines may be off where readers cut lines at their vertices anew.

        They cut a line at its nearest point to a vertex, so that the end moves by twice their
        distance in the part at most.
        """
        shape = self.part.shape
        edge = np.concatenate([np.arange(len(shape.edges)), shape.coedge_edge])[spots.owner]
        out = np.zeros(len(edge))
        for side in (0, 1):
            reach = 2 * self.loose_ends[spots.owner, side]
            away = self.part.points[shape.edges[edge, side]] - spots.position
            near = np.linalg.norm(away, axis=1) <= reach + self.tolerance
            out = np.maximum(out, np.where(near & (shape.edges[edge, side] >= 0), reach, 0))
        return out

    @cached_property
    def faces(self) -> tuple[Spots, Spots]:
        """Spots on the faces of the part and of the file."""
        return face_spots(self.part, self.samples), face_spots(self.file, self.samples)

    @cached_property
    def lines(self) -> tuple[Spots, Spots]:
        """Spots on the lines of the part and of the file."""
        return line_spots(self.part), line_spots(self.file)

    @cached_property
    def found(self) -> tuple[Found, Found, Found, Found]:
        """Distances of the part's faces, the file's faces, the part's lines, the file's lines."""
        faces = Target.faces(self.part, self.faces[0]), Target.faces(self.file, self.faces[1])
        lines = Target.lines(self.part, self.lines[0]), Target.lines(self.file, self.lines[1])
        return (
            self._measured(*faces, "part", faces=True),
            self._measured(*faces[::-1], "file", faces=True),
            self._measured(*lines, "part", faces=False),
            self._measured(*lines[::-1], "file", faces=False),
        )

    def _measured(self, mine: Target, other: Target, side: str, *, faces: bool) -> Found:
        spots = mine.spots
        if self.ordered:
            owner, same = spots.owner, self.kept[0 if faces else 1][spots.owner]
            shares = other.at_shares(owner, mine.shares(owner, spots.params))
            # IGES readers let the ranges of lines begin at 0: only faces keep their parameters.
            start = np.where(same[:, None], spots.params, shares) if faces else shares
        else:
            owner, same = np.full(len(spots.owner), -1), np.zeros(len(spots.owner), dtype=bool)
            start = np.zeros_like(spots.params)
        feet = measure(other, owner, start, same, spots.position, self.settle, self.tolerance)
        if not faces:
            off = np.zeros(len(spots.owner))
            if self.ordered or side == "file":
                off = self.slack[spots.owner]
            if self.ordered or side == "part":
                off = np.maximum(off, self.cut(spots))
            feet = replace(
                feet,
                distance=np.maximum(feet.distance - off, 0),
                least=np.maximum(feet.least - off, 0),
            )
        return Found(spots, feet, side, faces)
