"""What a fit reached, in words, from the figures of its report."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any


def fit_lines(fit: dict[str, Any]) -> Iterator[str]:
    """Lines on the residual and the lattice, from `fits` of a report; warnings tell the rest."""
    yield f"fitted:   {_counted(fit['pairs'], 'pair')}"
    yield from residual_lines(fit)
    levels = fit["levels"]
    counts = ", ".join(f"{count:,}" for count in levels)
    spread = f" on {len(levels)} levels ({counts})" if len(levels) > 1 else ""
    yield f"lattice:  {_counted(fit['control_points'], 'control point')}{spread}"


def residual_lines(fit: dict[str, Any]) -> Iterator[str]:
    """Lines on how near the images come to their targets."""
    where = ""
    if fit["largest_at"] is not None:
        where = f" at ({', '.join(f'{x:.6g}' for x in fit['largest_at'])})"
    noise = f"; noise of the data {fit['noise']:.3g}" if fit["noise"] else ""
    yield f"residual: rms {fit['rms']:.3g}, largest {fit['largest']:.3g}{where}{noise}"
    yield f"within:   {fit['within_tolerance']:.2%} of the pairs within {fit['tolerance']:.3g}"


def _counted(count: int, one: str) -> str:
    return f"{count:,} {one}{'s' * (count != 1)}"
