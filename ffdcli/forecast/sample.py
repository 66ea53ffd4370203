"""What a mesh will be made into, from some of its facets, before the others are cut."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from ffdcli.arrays import Bools
from ffdcli.brep.assemble import assemble
from ffdcli.brep.geometry import Geometry, plan_geometry
from ffdcli.brep.shells import group_shells
from ffdcli.errors import CheckError
from ffdcli.forecast.counts import Counts, count_made, count_planned
from ffdcli.forecast.rates import Work
from ffdcli.mesh import CheckedMesh
from ffdcli.surface.facets import Facets
from ffdcli.surface.outlines import trace_outlines
from ffdcli.surface.partition import partition
from ffdcli.surface.refine import keep_overshoot_small, keep_weights_positive

# Facets in a sample, drawn at random; and how many are worth one before they are cut.
SAMPLE, MANY = 1000, 10_000


def sample_counts(
    checked: CheckedMesh,
    facets: Facets,
    work: Work,
    *,
    spare_planes: bool,
) -> tuple[Counts, Counts]:
    """Estimated counts of the exact result, and of what the tolerance leaves of it.

    Some facets are cut and composed as all of them will be; the counts grow with their number.

    Parameters
    ----------
    checked : CheckedMesh
    facets : Facets
    work : Work
        Without a tolerance both counts are equal.
    spare_planes
        As for :func:`~ffdcli.surface.refine.keep_overshoot_small`.
    """
    count = len(facets.groups.normal)
    few = min(count, SAMPLE)
    chosen = np.zeros(count, dtype=bool)
    chosen[np.random.default_rng(0).permutation(count)[:few]] = True
    geometry = _geometry(checked, facets, chosen, spare_planes)
    exact = count_planned(geometry, facets.volumes, len(checked.triangles))
    made = exact
    if work.tolerance is not None:
        from ffdcli.brep.reduce import reduce_brep

        gaps = geometry.bounds(facets.volumes).edges
        brep = assemble(geometry, facets.volumes, gaps)
        # The tolerance may not be met at that degree; then the whole will fail too, later.
        with suppress(CheckError):
            brep, _ = reduce_brep(brep, work.tolerance, work.max_degree)
        made = count_made(brep, facets.volumes, len(checked.triangles))
    share, closed = count / few, checked.soundness.closed
    return _of_all(exact, share, closed=closed), _of_all(made, share, closed=closed)


def _geometry(checked: CheckedMesh, facets: Facets, chosen: Bools, spare_planes: bool) -> Geometry:
    """Geometry of the chosen facets (G,) alone, cut as all will be."""
    groups = facets.groups
    rows = np.flatnonzero(chosen[groups.group])
    places = checked.mesh.vertices
    local = np.stack([volume.frame.to_local(places) for volume in facets.volumes], axis=1)
    some = replace(groups, group=groups.group[rows], sides=groups.sides[rows])
    parts = partition(local, checked.triangles[rows], replace(facets, groups=some))
    parts, _, _ = keep_overshoot_small(parts, spare_planes=spare_planes)
    parts, batches = keep_weights_positive(parts)
    outlines = trace_outlines(parts)
    shells = group_shells(checked.soundness.nesting, checked.polygon[rows], parts)
    return plan_geometry(parts, outlines, batches, shells, places)


def _of_all(some: Counts, share: float, *, closed: bool) -> Counts:
    """Counts of all facets from those of a share; edges of a closed mesh have two faces each."""
    coedges = some.coedges * share
    edges = coedges / 2 if closed else some.edges * share
    return replace(
        some,
        faces=some.faces * share,
        patches=some.patches * share,
        edges=edges,
        coedges=coedges,
        surface_points=some.surface_points * share,
        curve_points=some.curve_points * edges / max(some.edges, 1),
    )
