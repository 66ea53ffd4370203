"""Parametrisation: the parameters of points of the mesh in inverted volumes, and what they cost."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.lattice.octree_placement import require_preimages
from ffdcli.mesh import Mesh
from ffdcli.volume.adaptive.inverse_map import InverseMap
from ffdcli.volume.adaptive.parameters import Preimages

if TYPE_CHECKING:
    from ffdcli.lattice import BoxLattice, Lattice


@dataclass(frozen=True)
class Parametrization:
    """What it took to find parameters (PT in Table 1 of Song & Yang 2005).

    Parameters
    ----------
    points : int
        Points whose parameters were sought.
    iterations : int
        Most Newton steps that any of them took; those that have no parameters do not count.
    seconds : float
    """

    points: int = 0
    iterations: int = 0
    seconds: float = 0.0

    def __add__(self, other: Parametrization) -> Parametrization:
        """Both together."""
        return Parametrization(
            self.points + other.points,
            max(self.iterations, other.iterations),
            self.seconds + other.seconds,
        )

    @property
    def report(self) -> dict[str, Any]:
        """A `parametrization` section of a report."""
        return {
            "points": self.points,
            "iterations": self.iterations,
            "seconds": round(self.seconds, 4),
        }


def find_preimages(
    volume: InverseMap, points: Floats, member: BoxLattice
) -> tuple[Preimages, Parametrization]:
    """Parameters of points (m, 3) of the mesh, lattice frame, and what they cost.

    Raises
    ------
    LatticeError
        As :func:`~ffdcli.lattice.octree_placement.require_preimages`.
    """
    begun = time.perf_counter()
    found = volume.parameters(points)
    seconds = time.perf_counter() - begun
    require_preimages(volume, found, points, member.source)
    iterations = int(found.steps[found.solved].max(initial=0))
    return found, Parametrization(len(points), iterations, seconds)


def parametrize(mesh: Mesh, lattice: Lattice) -> Parametrization:
    """Find the parameters of the mesh's vertices in all inverted maps of a lattice.

    Raises
    ------
    LatticeError
        As :func:`find_preimages`.
    """
    vertices = mesh.vertices[np.unique(mesh.corners)]
    spent = Parametrization()
    for member in lattice.members:
        volume = member.map
        if volume.needs_fit:
            local = volume.frame.to_local(vertices)
            held = np.clip(local, volume.box[0], volume.box[1])
            near = np.all(np.abs(held - local) <= mesh.delta, axis=1)
            spent += find_preimages(volume, held[near], member)[1]
    return spent
