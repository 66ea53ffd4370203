"""What is asked of OpenCascade for one model: build it, check it, write it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from io import BytesIO

    from ffdcli.brep.occ.check import KernelVerdict
    from ffdcli.brep.record import Brep


class Kernel(Protocol):
    """OpenCascade, here or in a process of its own."""

    def load(self) -> None:
        """Wait until the kernel is there."""

    def build(self, brep: Brep) -> None:
        """Make the shape; see :func:`ffdcli.brep.occ.build.build_shape`."""

    def begin_check(self) -> Callable[[], KernelVerdict]:
        """Begin to check the shape; what comes back waits for the verdict, and is called once.

        See :func:`ffdcli.brep.occ.check.kernel_check`.
        """

    def write(self, path: str | Path, **how: Any) -> int:
        """Write the shape; see :func:`ffdcli.brep.occ.formats.write_cad`."""


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
            from ffdcli.brep.occ.build import build_shape

            self.shape = build_shape(brep)

    def read(self, stream: BytesIO) -> None:
        """Make the shape from its binary stream."""
        from ffdcli.brep.occ.build import shape_of_stream

        self.shape = shape_of_stream(stream)

    def begin_check(self) -> Callable[[], KernelVerdict]:
        """Check the shape when the verdict is asked for."""
        from ffdcli.brep.occ.check import kernel_check

        return lambda: kernel_check(self.shape)

    def write(self, path: str | Path, **how: Any) -> int:
        """Write the shape."""
        from ffdcli.brep.occ.formats import write_cad

        return write_cad(self.shape, path, **how)
