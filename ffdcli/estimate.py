"""Estimate the counts, file size, time and memory of a run from its plan alone."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.forecast.counts import Counts, count_planned
from ffdcli.forecast.rates import Work, memory_of
from ffdcli.forecast.require import Memory, foresee
from ffdcli.forecast.sample import sample_counts

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice
    from ffdcli.pipeline import Plan

# Each per control point of surfaces and curves, per use of an edge by a face, and per face; least
# squares over results of 60 to 2,500 faces, plane and curved, of degree 1 to 9.
_BYTES = {
    "STEP": (114.0, 748.0, 492.0),
    "IGES": (238.0, 871.0, 0.0),
    "BREP": (66.0, 135.0, 0.0),
    "direct": (85.0, 480.0, 260.0),
}
_WRITE_SECONDS = {
    "STEP": (6.1e-6, 36e-6, 775e-6),
    "IGES": (8.4e-6, 7e-6, 482e-6),
    "BREP": (3.6e-6, 32e-6, 38e-6),
    "direct": (0.4e-6, 8e-6, 8e-6),
}
_SHAPE_SECONDS = (0.7e-6, 23e-6, 0.0)
_CHECK_SECONDS = (2.2e-6, 110e-6, 0.0)
# To start; to load OpenCascade.
_START_SECONDS, _LOAD_SECONDS = 1.2, 0.8
# A weight beside each control point.
_WEIGHT_SHARE = 0.2


@dataclass(frozen=True)
class Estimate:
    """Exact counts of what a run will make, and its approximate size, time and memory.

    Parameters
    ----------
    faces, patches, edges, control_points : int
        As in the report of the run; with a tolerance the control points are estimated too.
    bytes : int
        Within a third of the file's size.
    seconds : float
        Within a factor of three on an idle desktop machine of 2023.
    memory : Memory
    by_writer : dict of str to int, bytes
        The memory with each writer that makes this kind of file.
    """

    faces: int
    patches: int
    edges: int
    control_points: int
    bytes: int
    seconds: float
    memory: Memory
    by_writer: dict[str, int]

    @property
    def report(self) -> dict[str, Any]:
        """The fields of reports."""
        counts = {name: value for name, value in asdict(self).items() if name != "by_writer"}
        memory = {**self.memory.report, "by_writer": self.by_writer}
        return {**counts, "seconds": round(self.seconds, 1), "memory": memory}


def estimate(plan: Plan, lattice: Lattice, work: Work) -> Estimate:
    """Estimate the run of a lattice on a planned mesh.

    Parameters
    ----------
    plan : Plan
    lattice : Lattice
        With the knots of the plan.
    work : Work
        It writes a file.
    """
    assert work.kind is not None
    fitted = plan.fit(lattice)
    volumes = lattice.volumes if fitted is None else fitted.lattice.volumes
    checked, facets = plan.origin.checked, plan.geometry.parts.facets
    exact = made = count_planned(plan.geometry, volumes, len(checked.triangles))
    if work.tolerance is not None:
        facets = replace(facets, volumes=volumes)
        some = sample_counts(checked, facets, work, spare_planes=plan.for_one_net)
        made = exact.reduced_as(*some)
    rational = any(volume.net_kind.rational for volume in volumes)
    points = (made.surface_points + made.curve_points) * (1 + _WEIGHT_SHARE * rational)
    amounts = np.array([points, exact.coedges, exact.faces])
    direct = work.writer == "direct"
    kind = "direct" if direct else work.kind
    rates = np.array(_WRITE_SECONDS[kind])
    if not direct or work.judged:
        rates += _SHAPE_SECONDS
    if work.checked:
        rates += _CHECK_SECONDS
    loading = 0.0 if direct and not work.judged else _LOAD_SECONDS
    return Estimate(
        faces=int(exact.faces),
        patches=len(np.unique(plan.geometry.parts.patch)),
        edges=int(exact.edges),
        control_points=round(made.surface_points),
        bytes=int(amounts @ _BYTES[kind]),
        seconds=float(_START_SECONDS + loading + amounts @ rates),
        memory=foresee(work, exact, made),
        by_writer=_by_writer(work, exact, made),
    )


def _by_writer(work: Work, exact: Counts, made: Counts) -> dict[str, int]:
    found = {"kernel": memory_of(replace(work, writer="kernel"), exact, made)}
    if work.kind == "STEP":
        direct = replace(work, writer="direct", judged=work.judged and work.writer == "direct")
        found["direct"] = memory_of(direct, exact, made)
    return found
