"""Lattice files that are begun for a model."""

from __future__ import annotations

from pathlib import Path

from ffdcli.lattice import OctreeStart, starter_text
from ffdcli.mesh import Mesh
from ffdcli.messages import printable
from ffdcli.models import as_mesh
from ffdcli.part.record import Part


def starter(model: Path, place: Path, record: Mesh | Part, volume: str) -> str:
    """Text of a lattice file as ``ffd new`` makes it."""
    octree = None
    if volume in ("tspline", "hierarchical"):
        vertices = as_mesh(record).vertices
        octree = OctreeStart(volume, 4, vertices[vertices[:, 2].argmax()])
    text = starter_text(
        mesh=printable(str(model)),
        bounds=record.bounds,
        delta=record.delta,
        unit=record.unit,
        lattice=printable(str(place)),
        octree=octree,
    )
    return text.replace("\nvolume: bspline\n", f"\nvolume: {volume}\n") if octree is None else text
