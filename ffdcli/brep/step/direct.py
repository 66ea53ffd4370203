"""The direct writer of STEP files, used like OpenCascade; that is asked for its verdict only."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.brep.occ.processes.kernel import Agree, Kernel
from ffdcli.brep.occ.writing.far_from_origin import require_parts_in
from ffdcli.brep.record import Brep
from ffdcli.brep.step.write import write_step

if TYPE_CHECKING:
    from ffdcli.brep.occ.check import KernelVerdict


class DirectWriter:
    """A :class:`~ffdcli.brep.occ.processes.kernel.Kernel` that writes STEP files by itself.

    Parameters
    ----------
    brep : Brep
    judge : Kernel or None
        OpenCascade, if the shape must pass its check; else it is not even loaded.
    """

    def __init__(self, brep: Brep, judge: Kernel | None) -> None:
        self._brep, self._judge = brep, judge

    def load(self) -> None:
        """Wait until OpenCascade is imported, if it is to check the shape."""
        if self._judge is not None:
            self._judge.load()

    def build(self, brep: Brep) -> None:
        """Make the shape, if OpenCascade is to check it."""
        if self._judge is not None:
            self._judge.build(brep)

    def begin_check(self) -> None:
        """Start OpenCascade's check, if it is wanted."""
        if self._judge is not None:
            self._judge.begin_check()

    def verdict(self) -> KernelVerdict:
        """OpenCascade's verdict."""
        assert self._judge is not None
        return self._judge.verdict()

    def write(
        self, path: str | Path, *, agree: Agree | None = None, iges_mode: str = "", **how: Any
    ) -> int:
        """Write the B-rep; see :func:`ffdcli.brep.step.write.write_step`."""

        def judge(written: Path) -> None:
            require_parts_in(written, _largest_coordinate(self._brep))
            if agree is not None and self._judge is not None:
                agree(self.verdict())

        return write_step(self._brep, path, before_place=judge, **how)


def _largest_coordinate(brep: Brep) -> float:
    """The largest coordinate of vertices and control points."""
    largest = float(np.abs(brep.points).max(initial=0.0))
    for poles in (*(each.poles for each in brep.curves), *(each.poles for each in brep.surfaces)):
        points = poles if poles.shape[-1] == 3 else poles[..., :3] / poles[..., 3:]
        largest = max(largest, float(np.abs(points).max(initial=0.0)))
    return largest
