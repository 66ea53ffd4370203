"""Shells and solids of regions, and the shells that a deformation turns inside out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, places_in_runs
from ffdcli.mesh.shells import ShellNesting
from ffdcli.surface.partition import Partition
from ffdcli.volume.protocol import Volume

# Approximate number of pieces per shell at which the sense of the deformation is sampled.
_SENSE_SAMPLES = 500


@dataclass(frozen=True)
class Shells:
    """The shell of each region and the solid of each shell.

    Parameters
    ----------
    region_shell : (R,) int64
    closed : (S,) bool
    solid : (S,) int64
        -1 for an open shell; the first shell of a solid is its outer one.
    senses : tuple of SenseSamples
        Points at which the sense of the deformation is sampled.
    """

    region_shell: Ints
    closed: Bools
    solid: Ints
    senses: tuple[SenseSamples, ...]

    def mirrored(self, volumes: Sequence[Volume]) -> Bools:
        """(S,) True for shells turned inside out: det J < 0 at most of their samples."""
        total = np.zeros(len(self.closed))
        for samples in self.senses:
            slopes = volumes[samples.zone].jacobian(samples.points)
            np.add.at(total, samples.shell, np.sign(np.linalg.det(slopes)))
        return np.asarray(total < 0)


@dataclass(frozen=True)
class SenseSamples:
    """Points of shells in one lattice box.

    Parameters
    ----------
    zone : int
        Index of the volume.
    shell : (m,) int64
    points : (m, 3) float64, lattice frame
    """

    zone: int
    shell: Ints
    points: Floats


def group_shells(nesting: ShellNesting, polygon: Ints, parts: Partition) -> Shells:
    """Group regions into shells, and shells into solids: an outer shell and its cavities.

    Parameters
    ----------
    nesting : ShellNesting
        Bodies of the polygons of the mesh.
    polygon : (T,) int64
        Polygon of each uncut triangle.
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
    region_shell = place[body]
    senses = _sense_samples(parts, region_shell)
    return Shells(region_shell, nesting.closed[rank], solid[rank], senses)


def _sense_samples(parts: Partition, region_shell: Ints) -> tuple[SenseSamples, ...]:
    """Centres of some pieces of every shell.

    They are clipped to their box: beyond it the deformation is the identity.
    """
    inside = np.flatnonzero(parts.inside[parts.patch[parts.region]])
    shell = region_shell[parts.region[inside]]
    order = np.argsort(shell, kind="stable")
    members = np.bincount(shell)
    place = places_in_runs(members)
    step = np.maximum(1, members // _SENSE_SAMPLES)
    sampled = order[place % step[shell[order]] == 0]
    pieces = parts.pieces
    middle = np.add.reduceat(pieces.vertices[pieces.corners], pieces.starts[:-1], axis=0)
    middle = (middle / np.diff(pieces.starts)[:, None, None])[inside[sampled]]
    zone = parts.zone[parts.patch[parts.region[inside[sampled]]]]
    samples = []
    for number, volume in enumerate(parts.facets.volumes):
        mine = zone == number
        points = np.clip(middle[mine, number], volume.box[0], volume.box[1])
        samples.append(SenseSamples(number, shell[sampled[mine]], points))
    return tuple(samples)
