"""What is asked of OpenCascade for one model: build it, check it, write it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from ffdcli.brep.occ.check import KernelVerdict
    from ffdcli.brep.record import Brep

# What is made of the kernel's verdict; it raises where the shape is not to be written.
Agree = Callable[["KernelVerdict"], None]


class Kernel(Protocol):
    """OpenCascade, here or in a process of its own."""

    def load(self) -> None:
        """Wait until the kernel is there."""

    def build(self, brep: Brep) -> None:
        """Make the shape; see :func:`ffdcli.brep.occ.building.build.build_shape`."""

    def begin_check(self) -> None:
        """Begin to check the shape, where that can be done beside other work."""

    def write(self, path: str | Path, *, agree: Agree | None = None, **how: Any) -> int:
        """Write the shape; see :func:`ffdcli.brep.occ.writing.write.begin_cad`.

        With ``agree`` the shape is checked (:func:`ffdcli.brep.occ.check.kernel_check`), and the
        file takes its place only after ``agree`` has seen the verdict and has not raised.
        """


class LocalKernel:
    """OpenCascade in this process; the shape is made once.

    While it works no other thread of Python does, and no signal is answered.
    """

    def __init__(self) -> None:
        self.shape: Any = None

    def load(self) -> None:
        """Import OpenCascade."""
        import OCP  # noqa: F401

    def build(self, brep: Brep) -> None:
        """Make the shape."""
        if self.shape is None:
            from ffdcli.brep.occ.building.build import build_shape

            self.shape = build_shape(brep)

    def begin_check(self) -> None:
        """Nothing is done beside other work here."""

    def write(self, path: str | Path, *, agree: Agree | None = None, **how: Any) -> int:
        """Write the shape, checked before where that is asked for."""
        from ffdcli.brep.occ.check import kernel_check
        from ffdcli.brep.occ.writing.write import write_cad

        if agree is not None:
            agree(kernel_check(self.shape))
        return write_cad(self.shape, path, **how)
