"""The exact faces of the deformed model, as triangles for drawing."""

from __future__ import annotations

import threading

import numpy as np

from ffdcli.editor.drawn import Drawn, coloured
from ffdcli.lattice import Lattice
from ffdcli.mesh import Mesh
from ffdcli.part.plan import PartPlan
from ffdcli.part.record import Part
from ffdcli.pipeline import prepare
from ffdcli.plan import Plan
from ffdcli.stopwatch import Progress
from ffdcli.view.deformation_scene import CHORD


class ExactFaces:
    """Exact faces of one model; the plan is kept from one lattice to the next where it serves.

    Parameters
    ----------
    model : Mesh or Part
    """

    def __init__(self, model: Mesh | Part) -> None:
        self.model = model
        self._plan: Plan | PartPlan | None = None
        self._lock = threading.Lock()

    def of(self, lattice: Lattice, progress: Progress | None = None) -> Drawn:
        """The faces that ``ffd deform`` makes, in the colours of ``ffd view``.

        Raises
        ------
        FfdError
            The model has faults that no face can be made of, or a face cannot be made.
        """
        with self._lock:
            return self._of(lattice, progress)

    def _of(self, lattice: Lattice, progress: Progress | None) -> Drawn:
        if self._plan is None or not self._plan.serves(lattice):
            self._plan = prepare(self.model, lattice, progress=progress)
        if isinstance(self._plan, Plan):
            result = self._plan.deform(lattice, check=False, progress=progress)
            mesh = result.tessellate(CHORD * self.model.size, progress=progress)
            return coloured(mesh.rest, mesh.points, mesh.triangles, mesh.owner)
        made = self._plan.deform(lattice, progress=progress)
        fine, rest = made.triangles(CHORD * self.model.size)
        # Neighbouring faces have bit-equal points on their shared edge.
        _, same = np.unique(fine.points, axis=0, return_inverse=True)
        return coloured(rest, fine.points, fine.corners, fine.face, same.reshape(-1)[fine.corners])
