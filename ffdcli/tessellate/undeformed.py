"""What a result keeps of the undeformed model, for triangles of its surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ffdcli.arrays import Floats, Ints
from ffdcli.deformation import Deformation

if TYPE_CHECKING:
    from ffdcli.tessellate.texture import Texture


@dataclass(frozen=True)
class Undeformed:
    """Undeformed vertices and faces of a B-rep, and its deformation.

    Parameters
    ----------
    rest : (V, 3) float64, model length
        Undeformed vertices.
    polygon : (F,) int64
        A polygon of each face; faces may consist of several.
    deformation : Deformation
    texture : Texture or None
        Texture coordinates of the vertices in each face, if faces keep them.
    """

    rest: Floats
    polygon: Ints
    deformation: Deformation
    texture: Texture | None = None
