"""A shape under a deformation: positions and tangents of its faces and of its lines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.bspline import chunks
from ffdcli.verify.deformed_mesh import POINTS, ModelMap

if TYPE_CHECKING:
    from ffdcli.brep.occ.part.sample import SampledShape


@dataclass(frozen=True, eq=False)
class DeformedShape:
    """A shape under a deformation, which may be the identity.

    Its lines are the curves of its edges, and behind them the images of its coedges' pcurves on
    their faces: coedge ``c`` is line ``len(edges) + c``.

    Parameters
    ----------
    shape : SampledShape
    deformation : ModelMap
    """

    shape: SampledShape
    deformation: ModelMap

    @cached_property
    def points(self) -> Floats:
        """(V, 3) images of the vertices."""
        return self.deformation.images(self.shape.points)

    @property
    def face_count(self) -> int:
        """Number of faces."""
        return len(self.shape.face_reversed)

    @cached_property
    def line_breaks(self) -> tuple[Floats, ...]:
        """Ends and breaks of the parameter of each line; twice the same where there is none."""
        return (*self.shape.edge_breaks, *self.shape.coedge_breaks)

    @cached_property
    def line_there(self) -> Bools:
        """Whether there is such a line: edges that are points have no curve."""
        return np.array([each[-1] > each[0] for each in self.line_breaks], dtype=bool)

    def on_faces(self, face: Ints, uv: Floats) -> tuple[Floats, Floats]:
        """Positions (n, 3) and tangents (n, 2, 3) of faces (n,) at parameters (n, 2)."""
        return self._images(*self.shape.on_faces(face, uv))

    def on_lines(self, line: Ints, at: Floats) -> tuple[Floats, Floats]:
        """Positions (n, 3) and tangents (n, 1, 3) of lines (n,) at parameters (n, 1)."""
        count = len(self.shape.edges)
        position, tangents = np.empty((len(line), 3)), np.empty((len(line), 1, 3))
        edges, coedges = np.flatnonzero(line < count), np.flatnonzero(line >= count)
        position[edges], tangents[edges, 0] = self.shape.on_edges(line[edges], at[edges, 0])
        coedge = line[coedges] - count
        uv, along = self.shape.on_pcurves(coedge, at[coedges, 0])
        position[coedges], sides = self.shape.on_faces(self.shape.coedge_face[coedge], uv)
        tangents[coedges, 0] = np.einsum("nk,nkx->nx", along, sides)
        return self._images(position, tangents)

    def _images(self, points: Floats, tangents: Floats) -> tuple[Floats, Floats]:
        position, slopes = np.empty_like(points), np.empty_like(tangents)
        for part in chunks(len(points), POINTS):
            position[part] = self.deformation.images(points[part])
            turn = np.swapaxes(self.deformation.jacobian(points[part]), 1, 2)
            slopes[part] = tangents[part] @ turn
        return position, slopes
