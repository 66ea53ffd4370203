"""Panel of the error map: signed distance of a mesh from the exact surface, in colours."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.deformation import Deformation
from ffdcli.formats import Subdivision
from ffdcli.mesh import Mesh
from ffdcli.tessellate.signed_errors import signed_errors
from ffdcli.triangles import deform_mesh
from ffdcli.view import colours
from ffdcli.view.panel import Panel, Scale, Strokes, Triangles

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice

# With more triangles than this, fewer points are measured in each.
_MANY = 3_000


def error_panel(
    mesh: Mesh,
    lattice: Lattice,
    mode: Subdivision | Literal["exact"],
    *,
    tolerance: float | None = None,
) -> Panel:
    """Colour the triangles of a mesh by their distance from the exact surface.

    Parameters
    ----------
    mesh, lattice, mode, tolerance
        As for :func:`ffdcli.triangles.deform_mesh`.

    Raises
    ------
    MeshError, LatticeError, CheckError
    """
    made = deform_mesh(mesh, lattice, mode=mode, tolerance=tolerance, keep=(), check=False)
    parts = 4 if len(made.triangles) < _MANY else 2
    errors = signed_errors(made, Deformation.of(lattice, mesh.delta), parts=parts)
    count, each = errors.points.shape[:2]
    cells = (np.arange(count)[:, None, None] * each + errors.cells).reshape(-1, 3)
    value = errors.distance[:, errors.cells].mean(axis=2).ravel()
    largest = float(np.abs(errors.distance).max(initial=0.0))
    limit = largest or 1.0
    scale = signed_colours(np.linspace(-1, 1, 255))
    corners = made.points[made.triangles]
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    facets = Triangles(
        errors.points.reshape(-1, 3), cells, signed_colours(value / limit), False, even=True
    )
    kind = {"vertices": "vertices deformed", "exact": "tessellated"}.get(
        mode, f"{mode}ly subdivided"
    )
    title = f"{kind}: {count} triangles, at most {largest:.3g} {made.unit} from the exact surface"
    unit = f"{made.unit}, outside +"
    return Panel(
        title,
        (facets, Strokes(sides, colours.LINE, 0.6)),
        Scale(scale, -limit, limit, unit),
    )


def signed_colours(value: Floats) -> Floats:
    """Colours (n, 3) of values from -1 (blue) through 0 (nearly white) to 1 (vermilion)."""
    ends = np.array([colours.rgb(c) for c in (colours.BELOW, colours.NONE, colours.ABOVE)])
    places = np.array([-1.0, 0.0, 1.0])
    return np.stack([np.interp(value, places, ends[:, i]) for i in range(3)], axis=1)
