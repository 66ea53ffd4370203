"""Panel of the residual of fits: what the images of pairs lack to their targets, in colours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.errors import LatticeError
from ffdcli.mesh import Mesh
from ffdcli.triangles import deform_mesh
from ffdcli.view import colours
from ffdcli.view.panel import Panel, Scale, Strokes, Triangles

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice

# Pairs that are drawn at most: those with the largest residuals.
_MOST = 20_000
# Radius of the mark of a pair, relative to the mesh.
_RADIUS = 0.006
# An octahedron.
_CORNERS = np.concatenate([np.eye(3), -np.eye(3)])
_FACES = np.array(
    [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
)


def residual_panel(mesh: Mesh, lattice: Lattice) -> Panel:
    """The deformed mesh, and the images of all pairs coloured by their distance from the targets.

    Pairs that count less as outliers are violet.

    Raises
    ------
    LatticeError
        The lattice has no fit.
    """
    if not lattice.fits:
        message = "--residual needs a lattice with a `fit`"
        raise LatticeError(message, file=lattice.source.name, hint="add one, or leave it out")
    made = deform_mesh(mesh, lattice, mode="vertices", check=False)
    distance = np.concatenate([fit.distances for fit in lattice.fits])
    outlier = np.concatenate([fit.outlier for fit in lattice.fits])
    places = np.concatenate([_images(lattice, number) for number in range(len(lattice.fits))])
    kept = distance[~outlier]
    limit = float(kept.max(initial=0.0)) or 1.0
    shown = np.argsort(-distance, kind="stable")[:_MOST]
    colour = residual_colours(distance[shown].clip(0, limit) / limit)
    colour[outlier[shown]] = colours.rgb(colours.HIDDEN)
    radius = _RADIUS * float(np.linalg.norm(np.ptp(made.points, axis=0)))
    points = places[shown, None] + radius * _CORNERS
    faces = np.arange(len(shown))[:, None, None] * len(_CORNERS) + _FACES
    marks = Triangles(
        points.reshape(-1, 3),
        faces.reshape(-1, 3),
        np.repeat(colour, len(_FACES), axis=0),
        False,
        even=True,
    )
    corners = made.points[made.triangles]
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    within = np.mean([fit.as_report()["within_tolerance"] for fit in lattice.fits])
    rms = float(np.sqrt(np.mean(kept**2))) if len(kept) else 0.0
    title = f"fit: {len(distance):,} pairs, rms {rms:.3g} {made.unit}, largest {limit:.3g}, "
    title += f"{within:.1%} within the tolerance"
    return Panel(
        title,
        (marks, Strokes(sides, colours.LINE, 0.4, 0.3)),
        Scale(residual_colours(np.linspace(0, 1, 255)), 0.0, limit, f"residual, {made.unit}"),
    )


def residual_colours(value: Floats) -> Floats:
    """Colours (n, 3) of values from 0 (blue) through yellow to 1 (vermilion)."""
    ends = np.array([colours.rgb(c) for c in (colours.BELOW, colours.FACES[1], colours.ABOVE)])
    return np.stack([np.interp(value, [0.0, 0.5, 1.0], ends[:, i]) for i in range(3)], axis=1)


def _images(lattice: Lattice, number: int) -> Floats:
    """Images (m, 3) of the pairs of a fit in the deformed model."""
    fit = lattice.fits[number]
    out = np.array(fit.sources)
    for map_ in lattice.maps:
        local = map_.frame.to_local(fit.sources)
        inside = map_.contains(local)
        out[inside] = map_.frame.to_model(map_.evaluate(local[inside]))
    return out
