"""What a fit reached, in words, from the figures of its report."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any


def fit_lines(fit: dict[str, Any]) -> Iterator[str]:
    """Lines on the residual and the lattice, from `fits` of a report; warnings tell the rest."""
    yield f"fitted:   {_counted(fit['pairs'], 'pair')}"
    yield from residual_lines(fit)
    if "scan" in fit:
        yield from _scan_lines(fit["scan"], fit["tolerance"])
    levels = fit["levels"]
    counts = ", ".join(f"{count:,}" for count in levels)
    spread = f" on {len(levels)} levels ({counts})" if len(levels) > 1 else ""
    yield f"lattice:  {_counted(fit['control_points'], 'control point')}{spread}"


def residual_lines(fit: dict[str, Any]) -> Iterator[str]:
    """Lines on how near the images come to their targets."""
    noise = f"; noise of the data {fit['noise']:.3g}" if fit["noise"] else ""
    yield f"residual: rms {fit['rms']:.3g}, largest {fit['largest']:.3g}{_at(fit)}{noise}"
    yield f"within:   {fit['within_tolerance']:.2%} of the pairs within {fit['tolerance']:.3g}"


def _scan_lines(scan: dict[str, Any], tolerance: float) -> Iterator[str]:
    points = f"{scan['used']:,} of {_counted(scan['points'], 'point')} of the scan"
    yield f"scan:     {points}, which cover {scan['coverage']:.1%} of the model"
    share = f"{scan['within_tolerance']:.2%} of all points within {tolerance:.3g}"
    yield f"to model: {_distances(scan['scan_to_model'])}; {share}"
    yield f"to scan:  {_distances(scan['model_to_scan'])}, where covered"


def _distances(figures: dict[str, Any]) -> str:
    if figures["rms"] is None:
        return "none"
    return f"rms {figures['rms']:.3g}, largest {figures['largest']:.3g}{_at(figures)}"


def _at(figures: dict[str, Any]) -> str:
    """Where the largest distance is."""
    if figures["largest_at"] is None:
        return ""
    return f" at ({', '.join(f'{x:.6g}' for x in figures['largest_at'])})"


def _counted(count: int, one: str) -> str:
    return f"{count:,} {one}{'s' * (count != 1)}"
