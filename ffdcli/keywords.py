"""Keyword arguments of :mod:`ffdcli.pipeline`, for its overloads."""

from __future__ import annotations

from collections.abc import Collection
from typing import TypedDict

from ffdcli.brep.occ.targets import TargetName
from ffdcli.forecast import Work
from ffdcli.mesh_facets import Kept
from ffdcli.stopwatch import Progress
from ffdcli.surface.coplanar import Coplanar
from ffdcli.surface.facets import Patches


class PlanOptions(TypedDict, total=False):
    """Options of :func:`prepare`."""

    patches: Patches
    keep: Collection[Kept]
    coplanar: Coplanar | None
    fit_tolerance: float | None
    require_solid: bool
    once: bool
    work: Work | None
    progress: Progress | None
    warn: Progress | None


class DeformOptions(TypedDict, total=False):
    """Options of :func:`deform`."""

    patches: Patches
    coplanar: Coplanar | None
    tolerance: float | None
    max_degree: int | None
    target: TargetName
    fit_tolerance: float | None
    check: bool
    require_solid: bool
    require_injective: bool
    work: Work | None
    progress: Progress | None
    warn: Progress | None
