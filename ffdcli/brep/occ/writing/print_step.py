"""Print the entities of a STEP model, in several processes for large models.

Printing takes as long as making the entities, and entities are printed independently.
"""

from __future__ import annotations

from functools import partial
from io import BytesIO
from itertools import pairwise
from typing import Any

from ffdcli.brep.occ.fork import run_in_fork
from ffdcli.errors import KernelError

_BEGIN = b"ISO-10303-21;\n"
# Least number of entities for another process to pay off.
_WORTH = 20_000


def print_entities(
    model: Any, protocol: Any, digits: int, *, short: bool = False, processes: int = 1
) -> bytes:
    """Print a model; the text is the same whatever the number of processes.

    Parameters
    ----------
    model : Interface_InterfaceModel
    protocol : Interface_Protocol
    digits : int
        Significant digits.
    short : bool
        Leave trailing zeros out.
    processes : int
        Largest number of processes.

    Raises
    ------
    KernelError
        OpenCascade failed.
    """
    count = model.NbEntities()
    parts = max(1, min(processes, count // _WORTH))
    bounds = [1 + count * part // parts for part in range(parts + 1)]

    def part(first: int, end: int) -> bytes:
        return _print_range(model, protocol, digits, short, first, end)

    others = [run_in_fork(partial(part, first, end)) for first, end in pairwise(bounds[1:])]
    return b"".join([_BEGIN, part(bounds[0], bounds[1]), *(text() for text in others)])


def _print_range(
    model: Any, protocol: Any, digits: int, short: bool, first: int, end: int
) -> bytes:
    """Print entities ``first`` to ``end - 1``; the header goes with the first of all."""
    from OCP.StepData import StepData_StepWriter, StepData_WriterLib

    printer = StepData_StepWriter(model)
    # 17 significant digits name every double; the writer's default is 12 decimals.
    printer.FloatWriter().SetFormat(f"%.{digits - 1}E", True)
    printer.FloatWriter().SetZeroSuppress(short)
    if first == 1:
        printer.SendModel(protocol, True)
        printer.SendData()
    library = StepData_WriterLib(protocol)
    for number in range(first, end):
        printer.SendEntity(number, library)
    if end > model.NbEntities():
        printer.EndSec()
        printer.EndFile()
    # An error in a stream's write ends the process inside OpenCascade: only memory is safe.
    buffer = BytesIO()
    if not printer.Print(buffer) or buffer.tell() == 0:
        raise KernelError("OpenCascade could not print the STEP entities")
    return buffer.getvalue()
