"""OpenCascade's process-wide exchange settings, set for the length of a block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from ffdcli.errors import KernelError


@contextmanager
def exchange_settings(values: Mapping[str, str]) -> Iterator[None]:
    """Set exchange parameters and put the old values back afterwards.

    Parameters
    ----------
    values : mapping of str to str
        Names and values, as OpenCascade spells them.

    Raises
    ------
    KernelError
        A name or value is unknown to this OpenCascade.
    """
    from OCP.Interface import Interface_Static
    from OCP.STEPCAFControl import STEPCAFControl_Controller

    # Values set before the controllers exist are silently ignored.
    STEPCAFControl_Controller.Init_s()
    before = {name: Interface_Static.CVal_s(name) for name in values}
    try:
        for name, value in values.items():
            if not Interface_Static.SetCVal_s(name, value):
                raise KernelError(f"OpenCascade refused to set {name} to {value}")
        yield
    finally:
        for name, value in before.items():
            Interface_Static.SetCVal_s(name, value)
