"""The `octree` key of the lattice file as a model."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, Strict

from ffdcli.lattice.file.model_base import Corners, StrictModel

MAX_DEPTH = 9

Depth = Annotated[int, Field(ge=1, le=MAX_DEPTH)]
_Heavy = Annotated[float, Field(gt=0)]


class Refined(Corners):
    """A part of the box whose cells are divided down to a depth of their own."""

    depth: Depth = Field(description="How often cells that meet the part are halved.")


class OctreeSpec(StrictModel):
    """How the box of a tspline or hierarchical volume is divided into cells."""

    region: Literal["auto", "oriented", "minimum"] = Field(
        default="auto",
        description="What the octree spans. auto: what `box` says; oriented: a box along the "
        "mesh's principal axes; minimum: the turned box of least volume round the mesh.",
    )
    depth: Depth = Field(
        default=4, description="How often cells that hold part of the mesh are halved."
    )
    refine: Literal["surface", "vertices"] = Field(
        default="surface",
        description="Which cells are divided: those that the surface passes, or those that hold a "
        "vertex.",
    )
    also: Annotated[tuple[Refined, ...], Strict(False)] = Field(
        default=(),
        description="Boxes {min, max, depth}, in the coordinates of the edits, whose cells are "
        "divided down to a depth of their own.",
    )
    weights: Annotated[tuple[_Heavy, _Heavy], Strict(False)] = Field(
        default=(100.0, 1.0),
        description="tspline: weights at rest of the control points of cells that hold part of "
        "the mesh, and of the others, which are hidden.",
    )
    cells: str | None = Field(
        default=None,
        description="tspline: .csv file of a T-lattice, which takes the place of depth and also: "
        "u0,v0,w0,u1,v1,w1 per cell, whole numbers in units of which the box has as many as the "
        "highest; path relative to this file. null: the octree grows round the mesh.",
    )
    embedding: Literal["displacement", "inverse"] = Field(
        default="displacement",
        description="displacement: points move by what the edited volume differs from the volume "
        "at rest, both taken at the point itself; the identity at rest, and exact. inverse (only "
        "tspline): both taken where the volume at rest has the point, as Song & Yang do; surfaces "
        "are fitted, within --fit-tolerance.",
    )

    def written(self) -> dict[str, Any]:
        """The keys that count, as plain values: cells given take the place of depth and also."""
        return self.model_dump(exclude={"depth", "also"} if self.cells is not None else None)
