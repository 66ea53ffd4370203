"""Pydantic models of the `octree` key."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, Strict

from ffdcli.lattice.file.model_base import Corners, StrictModel

MAX_DEPTH = 9

Depth = Annotated[int, Field(ge=1, le=MAX_DEPTH)]
_Heavy = Annotated[float, Field(gt=0)]


class Refined(Corners):
    """A part of the box whose cells are divided to another depth."""

    depth: Depth = Field(description="Number of times that cells which meet the part are halved.")


class OctreeSpec(StrictModel):
    """Division of the box of a tspline or hierarchical volume into cells."""

    region: Literal["auto", "oriented", "minimum"] = Field(
        default="auto",
        description="The box of the octree. auto: as `box` says. oriented: a box along the "
        "principal axes of the mesh. minimum: the turned box of least volume round the mesh.",
    )
    depth: Depth = Field(
        default=4, description="Number of times that cells which hold part of the mesh are halved."
    )
    refine: Literal["surface", "vertices"] = Field(
        default="surface",
        description="Which cells are divided: those that the surface passes through, or those that "
        "hold a vertex.",
    )
    also: Annotated[tuple[Refined, ...], Strict(False)] = Field(
        default=(),
        description="Boxes {min, max, depth} whose cells are divided to another depth, in the "
        "coordinates of the edits.",
    )
    weights: Annotated[tuple[_Heavy, _Heavy], Strict(False)] = Field(
        default=(100.0, 1.0),
        description="tspline: weights at rest. The first is for control points of cells that hold "
        "part of the mesh, the second for all others, which are hidden.",
    )
    cells: str | None = Field(
        default=None,
        description="tspline: .csv file with the cells of a T-lattice, which replaces depth and "
        "also. One row u0,v0,w0,u1,v1,w1 per cell, in whole units; the highest number along an "
        "axis is the upper side of the box. The path is relative to this file. null: the octree "
        "is refined round the mesh.",
    )
    embedding: Literal["displacement", "inverse"] = Field(
        default="displacement",
        description="displacement: a point is moved by the difference of the edited volume and the "
        "volume at rest, both evaluated at the point. This is the identity at rest, and surfaces "
        "are exact. inverse (tspline only): both are evaluated at the parameters for which the "
        "volume at rest gives the point (Song & Yang 2005), and surfaces are fitted within "
        "--fit-tolerance.",
    )

    def written(self) -> dict[str, Any]:
        """The keys that have an effect, as plain values: `cells` replaces `depth` and `also`."""
        return self.model_dump(exclude={"depth", "also"} if self.cells is not None else None)
