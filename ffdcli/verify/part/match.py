"""Which face, edge and vertex of a file belongs to which of the part."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.verify.part.shape import DeformedShape

if TYPE_CHECKING:
    from ffdcli.brep.occ.part.sample import SampledShape

# Shares of a pcurve's range at which pcurves are compared, and the difference up to which they
# count as the same, as a share of what the face reaches.
_SHARES = np.linspace(0, 1, 7)
_SAME = 1e-6


def differing_counts(part: SampledShape, file: SampledShape) -> list[str]:
    """Messages for what the file holds more or fewer of than the part."""
    counts = []
    for shape in (part, file):
        counts.append(
            {
                "solids": shape.solid_count,
                "shells": len(shape.shell_closed),
                "faces": len(shape.face_reversed),
                "edges": len(shape.edges),
                "vertices": len(shape.points),
                "seams": int(shape.seam.sum()) // 2,
                "degenerate edges": int(shape.degenerate.sum()),
            }
        )
    return [
        f"the file holds {counts[1][what]} {what}, but the part has {wanted}"
        for what, wanted in counts[0].items()
        if counts[1][what] != wanted
    ]


def in_order(part: DeformedShape, file: DeformedShape) -> bool:
    """Whether faces, edges and vertices of both have the same neighbours, number by number."""
    fields = ("face_shell", "coedge_face", "coedge_edge", "edges", "degenerate", "seam")
    both = [(getattr(part.shape, name), getattr(file.shape, name)) for name in fields]
    return all(np.array_equal(*each) for each in (*both, (part.line_there, file.line_there)))


def same_parameters(part: SampledShape, file: SampledShape) -> tuple[Bools, Bools]:
    """Which pcurves (C,) and which faces (F,) have the same parameters in both.

    Pcurves are compared at the same shares of their ranges: IGES readers let ranges begin at 0.

    A face has kept its parameters if all its pcurves are the same curves at the same parameters.
    Both shapes must be in the same order.
    """
    there = np.array([ends[-1] > ends[0] for ends in part.coedge_breaks], dtype=bool)
    there &= np.array([ends[-1] > ends[0] for ends in file.coedge_breaks], dtype=bool)
    coedge = np.repeat(np.flatnonzero(there), len(_SHARES))
    one, other = (_pcurve_points(shape, coedge) for shape in (part, file))
    reach = np.array([[u[-1] - u[0], v[-1] - v[0]] for u, v in part.face_breaks]).reshape(-1, 2)
    off = np.abs(one - other) > _SAME * reach[part.coedge_face[coedge]]
    kept = there.copy()
    kept[coedge[off.any(axis=1)]] = False
    faces = np.bincount(part.coedge_face[~kept], minlength=len(reach)) == 0
    faces &= np.bincount(part.coedge_face, minlength=len(reach)) > 0
    return kept, faces


def _pcurve_points(shape: SampledShape, coedge: Ints) -> Floats:
    ends = np.array([(each[0], each[-1]) for each in shape.coedge_breaks]).reshape(-1, 2)[coedge]
    shares = np.tile(_SHARES, len(coedge) // len(_SHARES))
    at = np.clip(ends[:, 0] + shares * (ends[:, 1] - ends[:, 0]), ends[:, 0], ends[:, 1])
    return shape.on_pcurves(coedge, at)[0]
