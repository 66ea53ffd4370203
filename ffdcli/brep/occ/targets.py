"""Receivers and the choices that suit each, one row per program.

The reasons are in docs/reference/receivers.md.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

from ffdcli.brep.occ.formats import IgesMode, Schema
from ffdcli.errors import KernelError

TargetName = Literal["generic", "solidworks", "catia", "nx", "fusion", "rhino"]
TARGET_NAMES: tuple[str, ...] = get_args(TargetName)


@dataclass(frozen=True)
class Target:
    """Choices for a receiver.

    Parameters
    ----------
    name : str
    schema : {"ap203", "ap214", "ap242"}
        For STEP.
    pcurves : bool
        For STEP: give edges their curves in the parameters of their faces too.
    iges_mode : {"brep", "faces"}
        For IGES.
    max_degree : int or None
        The highest degree that the receiver can edit; a limit for reduced results.
    """

    name: TargetName
    schema: Schema = "ap214"
    pcurves: bool = True
    iges_mode: IgesMode = "brep"
    max_degree: int | None = None

    def cap(self, tolerance: float | None, max_degree: int | None) -> int | None:
        """Degree cap of a run: the requested one, or the receiver's if the result is reduced."""
        return self.max_degree if max_degree is None and tolerance is not None else max_degree

    def facts(self, kind: str | None) -> dict[str, Any]:
        """The choices that apply to a format (``STEP``, ``IGES``, ``BREP``), for the report."""
        used = {"STEP": ("schema", "pcurves"), "IGES": ("iges_mode",)}.get(kind or "", ())
        return {name: value for name, value in asdict(self).items() if name in ("name", *used)}


TARGETS = {
    target.name: target
    for target in (
        Target("generic"),
        Target("solidworks"),
        Target("catia"),
        Target("nx"),
        Target("fusion"),
        Target("rhino", pcurves=False, iges_mode="faces", max_degree=11),
    )
}


def target_named(name: str) -> Target:
    """The target of a name.

    Raises
    ------
    KernelError
        There is no such target.
    """
    if name not in TARGETS:
        raise KernelError(f"there is no target {name!r}", hint=f"use one of {', '.join(TARGETS)}")
    return TARGETS[name]
