"""Pydantic models of the `fit` edit: many pairs, met by least squares with a bending energy."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Tag

from ffdcli.lattice.file.drag_models import Hold, Pairs
from ffdcli.lattice.file.model_base import Listed, StrictModel, by_type
from ffdcli.lattice.file.selectors import Selector

Smooth = Annotated[
    Annotated[Literal["auto"], Tag("smooth-auto")]
    | Annotated[float, Field(ge=0), Tag("smooth-number")],
    by_type(
        "smooth",
        "must be auto or a number of at least 0",
        text="smooth-auto",
        number="smooth-number",
        fraction="smooth-number",
    ),
]


class FitPairs(StrictModel):
    """The pairs of a fit, for which Python takes arrays."""

    pairs: Pairs = Field(
        description="{from, to} or {from, by} for each point, in model coordinates; or a .csv "
        "file with the header row x,y,z,tx,ty,tz (targets) or x,y,z,dx,dy,dz (displacements)."
    )


class FitOptions(StrictModel):
    """The keys of a fit besides its pairs."""

    tolerance: float | None = Field(
        default=None,
        gt=0,
        description="Distance from its target within which an image is to be. With `octree: "
        "{depth: auto}` cells are divided until all are, or the rest is noise. null: a "
        "ten-thousandth of the diagonal of the lattice box.",
    )
    smooth: Smooth = Field(
        default="auto",
        description="Weight of the bending energy: the mean squared second derivative over the "
        "box, times the fourth power of its diagonal, beside the mean squared residual. auto: by "
        "generalised cross-validation, so that exact data is met and noise is not.",
    )
    scale: float = Field(
        default=1.0,
        description="Factor of all displacements. -1 compensates: it deforms the other way.",
    )
    robust: bool = Field(
        default=True,
        description="true: pairs that disagree with all their neighbours are named, and count "
        "less or not at all.",
    )
    pin: Listed[Selector] = Field(
        default=(),
        description="Selectors (as in `at`) of control points that do not move.",
    )
    hold: Listed[Hold] = Field(
        default=(),
        description="Parts that do not move: {point: [x, y, z]}, {inside: {min, max}} or {group: "
        "name}, in model coordinates. A part cannot be held rigid by a fit.",
    )


# The order of the bases puts `pairs` first.
class Fit(FitOptions, FitPairs):
    """Move many points to targets by least squares, as smoothly as the data allows."""
