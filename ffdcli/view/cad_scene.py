"""Make the scene of a CAD file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ffdcli.messages import printable
from ffdcli.view.deformation_scene import CHORD
from ffdcli.view.scene import Faces, Scene, colour_faces, skin


def scene_of_file(path: str | Path, unit: str = "mm") -> Scene:
    """Read a CAD file and collect its faces.

    Parameters
    ----------
    path : str or Path
    unit : str
        Unit of files that state none.

    Raises
    ------
    FileError, KernelError
    """
    from ffdcli.brep.occ.reading.read import read_cad
    from ffdcli.brep.occ.triangulate import triangulate

    model = read_cad(path)
    fine = triangulate(model.shape, CHORD)
    # Neighbouring faces have bit-equal points on their shared edge.
    _, same = np.unique(fine.points, axis=0, return_inverse=True)
    shared = same.reshape(-1)[fine.triangles]
    faces = len(fine.surfaces)
    name = Path(path).name
    return Scene(
        title=printable(name),
        facts=f"{faces} face{'s' * (faces > 1)}.",
        unit=model.unit or unit,
        amplitudes=np.ones(1),
        before=None,
        after=skin(fine.points[None], fine.triangles, fine.face),
        faces=Faces(fine.surfaces, None, colour_faces(shared, fine.face, faces)),
        lattices=(),
        drags=np.zeros((0, 2, 3)),
        cells=np.zeros((0, 2, 3)),
        hidden_points=False,
    )
