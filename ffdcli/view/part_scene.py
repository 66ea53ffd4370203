"""Make the scene of a CAD part and its deformation."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ffdcli.deformation import Deformation
from ffdcli.lattice import Lattice
from ffdcli.messages import printable
from ffdcli.part.result import PartResult
from ffdcli.view.deformation_scene import CHORD, amplitudes_of, cell_edges, drags_of, drawn_net
from ffdcli.view.scene import Faces, Scene, colour_faces, skin


def scene_of_part(lattice: Lattice, result: PartResult, *, hidden_points: bool = False) -> Scene:
    """Collect the scene of a part's deformation.

    Parameters
    ----------
    lattice : Lattice
        Settled by the part.
    result : PartResult
    hidden_points : bool
        Draw the hidden control points of octrees.

    Raises
    ------
    KernelError
        OpenCascade cannot divide a face into triangles.
    """
    part, report = result.deformed.part, result.report
    fine, rest = result.triangles(CHORD * part.size)
    amplitudes = amplitudes_of(lattice)
    between = [lattice.scaled(float(share)) for share in amplitudes[1:-1]]
    moved = [Deformation.of(each, part.delta).images(rest) for each in between]
    frames = np.stack([rest, *moved, fine.points])
    # Neighbouring faces have bit-equal points on their shared edge.
    _, same = np.unique(fine.points, axis=0, return_inverse=True)
    shares = ", ".join(f"{count} {how}" for how, count in report["faces_by"].items() if count)
    return Scene(
        title=printable(Path(part.source).name),
        facts=f"{part.face_count} faces: {shares}.",
        unit=result.unit,
        amplitudes=amplitudes,
        before=skin(rest[None], fine.corners, fine.face),
        after=skin(frames, fine.corners, fine.face),
        faces=Faces(
            degrees=result.face_kinds,
            deviation=result.deformed.face_errors,
            colour=colour_faces(same.reshape(-1)[fine.corners], fine.face, part.face_count),
        ),
        lattices=tuple(drawn_net(one, amplitudes) for one in lattice.members),
        drags=drags_of(lattice.members),
        cells=cell_edges(lattice.members),
        hidden_points=hidden_points,
    )
