"""Operations of OpenCascade on one model: build, check, write."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from ffdcli.brep.occ.check import KernelVerdict
    from ffdcli.brep.record import Brep

# Takes the result of the check, and raises an error if the shape must not be written.
Agree = Callable[["KernelVerdict"], None]


class Kernel(Protocol):
    """OpenCascade, in this process or another."""

    def load(self) -> None:
        """Wait until OpenCascade is imported."""

    def build(self, brep: Brep) -> None:
        """Make the shape; see :func:`ffdcli.brep.occ.building.build.build_shape`."""

    def begin_check(self) -> None:
        """Start to check the shape, if that can run in parallel."""

    def verdict(self) -> KernelVerdict:
        """The result of the check; see :func:`ffdcli.brep.occ.check.kernel_check`."""

    def write(self, path: str | Path, *, agree: Agree | None = None, **how: Any) -> int:
        """Write the shape; see :func:`ffdcli.brep.occ.writing.write.begin_cad`.

        With ``agree`` the shape is checked (:func:`ffdcli.brep.occ.check.kernel_check`), and the
        file is renamed into place only if ``agree`` accepts the result.
        """


class LocalKernel:
    """OpenCascade in this process; the shape is made once.

    While it works, it holds the interpreter lock, and no signal is handled.
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
        """Do nothing: :meth:`verdict` does the check."""

    def verdict(self) -> KernelVerdict:
        """Check the shape."""
        from ffdcli.brep.occ.check import kernel_check

        return kernel_check(self.shape)

    def write(self, path: str | Path, *, agree: Agree | None = None, **how: Any) -> int:
        """Write the shape, after a check if ``agree`` is given."""
        from ffdcli.brep.occ.writing.write import write_cad

        if agree is not None:
            agree(self.verdict())
        return write_cad(self.shape, path, **how)
