"""Shells and solids: which regions bound what, and which way round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.brep.record import Bools, Ints
from ffdcli.mesh.shells import ShellNesting
from ffdcli.surface.partition import Partition
from ffdcli.volume.protocol import Volume

# Vertices per shell at which the sense of the deformation is sampled.
_SENSE_SAMPLES = 500


@dataclass(frozen=True)
class Shells:
    """Which shell each region belongs to, and how shells make up solids.

    Parameters
    ----------
    region_shell : (R,) int64
    closed : (S,) bool
    solid : (S,) int64
        -1 for an open shell; the first shell of a solid is its outer one.
    """

    region_shell: Ints
    closed: Bools
    solid: Ints


def group_shells(nesting: ShellNesting, polygon: Ints, parts: Partition) -> Shells:
    """Shells of regions, and solids: an outward-facing body and the cavities inside it.

    Parameters
    ----------
    nesting : ShellNesting
        Bodies of the mesh's polygons.
    polygon : (T,) int64
        Polygon of each triangle that was cut.
    parts : Partition
    """
    sample = np.zeros(len(parts.patch), dtype=np.int64)
    sample[parts.region] = np.arange(parts.pieces.count)
    solid = np.full(len(nesting.closed), -1, dtype=np.int64)
    outer = np.flatnonzero(nesting.closed & (nesting.parent < 0))
    solid[outer] = np.arange(len(outer))
    cavity = np.flatnonzero(nesting.closed & (nesting.parent >= 0))
    solid[cavity] = solid[nesting.parent[cavity]]
    # Shells are numbered so that outer ones come before their cavities.
    rank = np.argsort(nesting.parent >= 0, kind="stable")
    place = np.argsort(rank)
    body = nesting.body[polygon[parts.pieces.triangle[sample]]]
    return Shells(place[body], nesting.closed[rank], solid[rank])


def find_mirrored(parts: Partition, shells: Shells, volume: Volume) -> Bools:
    """(S,) shells that the deformation turns inside out: det J < 0 at most of their vertices."""
    shell = shells.region_shell[parts.region[parts.pieces.owner]]
    result = np.zeros(len(shells.closed), dtype=bool)
    order = np.argsort(shell, kind="stable")
    bounds = np.searchsorted(shell[order], np.arange(len(result) + 1))
    for number in range(len(result)):
        corner = order[bounds[number] : bounds[number + 1]]
        step = max(1, len(corner) // _SENSE_SAMPLES)
        points = parts.pieces.vertices[parts.pieces.corners[corner[::step]]]
        result[number] = bool(np.median(np.linalg.det(volume.jacobian(points))) < 0)
    return result
