"""Memory that a run takes at most, from what it makes: the table of measured rates.

``python benchmarks/memory.py`` measures it again; the test beside it compares the two.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ffdcli.brep.occ.formats import Checks, Writer, cad_format
from ffdcli.forecast.counts import Counts

# Of this process and of OpenCascade's before they have work, bytes.
START, KERNEL_START = 95e6, 270e6
# Most bytes held beyond that, in all processes together, in each stage: in any case, where work is
# done in parts; per triangle of the mesh, face, use of an edge by a face, number of a control
# point, and control point of a lattice.
RATES = {
    "plan": (5e6, 650.0, 560.0, 310.0, 7.5, 320.0),
    "folds": (48e6, 650.0, 560.0, 310.0, 7.5, 320.0),
    "surfaces": (5e6, 650.0, 670.0, 350.0, 21.5, 320.0),
    "reduce": (58e6, 650.0, 670.0, 350.0, 24.0, 320.0),
    "check": (27e6, 650.0, 1220.0, 1250.0, 8.0, 320.0),
    "direct": (22e6, 650.0, 1020.0, 950.0, 44.0, 320.0),
    "verdict": (0.0, 650.0, 4570.0, 8700.0, 85.0, 320.0),
    "STEP": (0.0, 650.0, 6170.0, 12100.0, 340.0, 320.0),
    "IGES": (0.0, 650.0, 5970.0, 11700.0, 340.0, 320.0),
    "BREP": (0.0, 650.0, 4370.0, 8500.0, 105.0, 320.0),
}
# Stages in OpenCascade's process.
KERNEL_STAGES = ("verdict", "STEP", "IGES", "BREP")


@dataclass(frozen=True)
class Work:
    """What is to be done with surfaces once they are planned.

    Parameters
    ----------
    kind : {"STEP", "IGES", "BREP"} or None
        The file to write; None for none.
    writer : {"kernel", "direct"}
    checked : bool
        Whether our own check is made.
    judged : bool
        Whether OpenCascade checks the shape.
    tolerance, max_degree
        As for :func:`ffdcli.deform`.
    """

    kind: str | None = None
    writer: Writer = "kernel"
    checked: bool = True
    judged: bool = False
    tolerance: float | None = None
    max_degree: int | None = None

    @classmethod
    def writing(
        cls, path: str | Path, writer: Writer, check: bool | Checks, **reduction: Any
    ) -> Work:
        """The work of ``Result.write``, after a reduction with ``tolerance`` and ``max_degree``."""
        judged = check == "kernel" or (check is True and writer == "kernel")
        return cls(cad_format(path), writer, checked=bool(check), judged=judged, **reduction)


def memory_of(work: Work, exact: Counts, made: Counts) -> int:
    """Most memory that a run takes in all its processes together, bytes.

    Parameters
    ----------
    work : Work
    exact : Counts
        Of the exact result.
    made : Counts
        Of what a tolerance leaves of it.
    """
    return int(max(_peaks(work, exact, made)))


def memory_held(exact: Counts) -> int:
    """Most memory that a run may hold before it writes, with OpenCascade loaded; bytes."""
    return int(START + KERNEL_START + max(bytes_of("plan", exact), bytes_of("surfaces", exact)))


def bytes_of(stage: str, counts: Counts) -> float:
    """Most bytes that a stage takes beyond those of the start."""
    return sum(rate * amount for rate, amount in zip(RATES[stage], amounts_of(counts), strict=True))


def amounts_of(counts: Counts) -> tuple[float, ...]:
    """What the rates are multiplied by."""
    own = (counts.triangles, counts.faces, counts.coedges, counts.numbers, counts.net_points)
    return (1.0, *own)


def _peaks(work: Work, exact: Counts, made: Counts) -> Iterator[float]:
    """Bytes in each stage of the work."""
    yield START + bytes_of("plan", exact)
    yield START + bytes_of("folds", exact)
    yield START + bytes_of("surfaces", exact)
    if work.tolerance is not None:
        yield START + bytes_of("reduce", exact)
    if work.checked:
        yield START + bytes_of("check", made)
    if work.judged:
        yield START + KERNEL_START + bytes_of("verdict", made)
    if work.kind is not None:
        direct = work.writer == "direct"
        stage = "direct" if direct else work.kind
        yield START + (0.0 if direct else KERNEL_START) + bytes_of(stage, made)
