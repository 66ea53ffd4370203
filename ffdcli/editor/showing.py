"""What a session shows: the model, the lattices, previews of edits, folds, and what is picked."""

from __future__ import annotations

from functools import cached_property
from typing import Any, Literal

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.editor import nets
from ffdcli.editor.core import locked
from ffdcli.editor.drawn import Drawn, draw_model
from ffdcli.editor.entry_text import plain_values
from ffdcli.editor.exact import ExactFaces
from ffdcli.editor.keeping import FileSession
from ffdcli.editor.mirror import NEAR
from ffdcli.editor.picking import (
    Hit,
    first_hit,
    into_boxes,
    lattice_of,
)
from ffdcli.editor.preview import Preview
from ffdcli.editor.proofs import Folds, Stop
from ffdcli.editor.shown import KeptFunctions, Shown
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.stopwatch import Progress
from ffdcli.view.deformation_scene import cell_edges


class ShownSession(FileSession):
    """A session whose model and lattices can be drawn."""

    _shown: Shown | None = None

    @property
    def title(self) -> str:
        """Names of the model and of the lattice file."""
        return f"{self.model_path.name} · {self.path.name}"

    @property
    def bounds(self) -> Floats:
        """(2, 3) box of the undeformed model."""
        return self.model.bounds

    @property
    def size(self) -> float:
        """Diagonal of that box, model length."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    def member(self, n: int | None = None) -> BoxLattice:
        """A lattice with all edits; the active one by default."""
        return self.lattice.members[self._number(n)]

    def weighted(self, n: int | None = None) -> bool:
        """Whether control points have weights."""
        return self.member(n).spec.weighted

    # What is drawn.

    @cached_property
    def drawn(self) -> Drawn:
        """The triangles of the model; constant."""
        with self.lock:
            return draw_model(self.model, self.mesh)

    @cached_property
    def _kept(self) -> KeptFunctions:
        return KeptFunctions(self.drawn, self.model.delta)

    @property
    def shown(self) -> Shown:
        """What is shown of the lattices as they are."""
        with self.lock:
            if self._shown is None or self._shown.lattice is not self.lattice:
                self._shown = Shown(
                    self._stages, self.lattice, self.drawn, self._kept, self.model.delta
                )
            return self._shown

    @property
    def vertices(self) -> Floats:
        """(V, 3) the drawn vertices as they are."""
        return self.shown.vertices

    def vertices_at(self, share: float) -> Floats:
        """(V, 3) the drawn vertices with a share of all edits."""
        return self.shown.vertices_at(share)

    def image(self, points: Any, share: float = 1.0) -> Floats:
        """Images (m, 3) of points (m, 3) of the undeformed model."""
        return self.shown.images(np.asarray(points, dtype=np.float64).reshape(-1, 3), share)

    @property
    def nets(self) -> tuple[nets.Net, ...]:
        """The control points of each lattice."""
        return self.shown.nets

    def nets_at(self, share: float) -> tuple[Floats, ...]:
        """(m, 3) control points of each lattice with a share of all edits."""
        return self.shown.nets_at(share)

    @property
    def cells(self) -> Floats:
        """(k, 2, 3) edges of the octrees' cells that hold part of the model."""
        return cell_edges(self.lattice.members)

    @property
    def folds(self) -> Folds:
        """Whether and where the model is folded."""
        return self.shown.folds

    @locked
    def get_ready(self) -> None:
        """Make what previews need, so that the first one is as quick as the others."""
        for number in range(self.count):
            self.shown.previews(number)

    @locked
    def preview(self, *edits: dict[str, Any], n: int | None = None) -> Preview:
        """What edits would lead to; nothing is changed.

        Raises
        ------
        LatticeError
            They cannot be made.
        """
        return self.shown.preview(self._number(n), [*map(plain_values, edits)])

    def last_proved(self, *edits: dict[str, Any], n: int | None = None) -> Stop:
        """How far edits go until they are not proved to fold nothing.

        Raises
        ------
        LatticeError
            They cannot be made.
        """
        return self.shown.last_proved(self._number(n), [*map(plain_values, edits)])

    def exact(self, progress: Progress | None = None) -> Drawn:
        """The exact faces of the deformed model; slow, for a thread of its own.

        Raises
        ------
        FfdError
            They cannot be made.
        """
        return self._exact.of(self.lattice, progress)

    @cached_property
    def _exact(self) -> ExactFaces:
        return ExactFaces(self.model)

    # What is picked.

    def hit(self, origin: Any, direction: Any, share: float = 1.0) -> Hit | None:
        """Where a ray meets the drawn model as it is; None where it passes by."""
        return first_hit(self.drawn, self.shown.vertices_at(share), origin, direction)

    def lattice_at(self, point: Any) -> int | None:
        """Number of the lattice whose box holds a point of the undeformed model; None for none."""
        given = np.asarray(point, dtype=np.float64).reshape(1, 3)
        members = self.lattice.members
        number = int(lattice_of(members, into_boxes(members, given, NEAR * self.size))[0])
        return number if number >= 0 else None

    def slice_mask(self, axis: Literal["u", "v", "w"], index: int, n: int | None = None) -> Bools:
        """(m,) the control points of a layer across an axis."""
        net = self.nets[self._number(n)]
        return nets.slice_mask(net, self.member(n), "uvw".index(axis), index)

    def near_mask(self, origin: Any, direction: Any, radius: float, n: int | None = None) -> Bools:
        """(m,) the first control point that a ray passes within a radius; or none."""
        net = self.nets[self._number(n)]
        return nets.near_mask(net, np.asarray(origin), np.asarray(direction), radius)
