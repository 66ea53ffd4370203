"""Rows about fields of displacements at many points."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from measure import Row, child, run_process

PAIRS = {"full": 100_000, "small": 2_000}
# Neighbours of scipy's radial functions; the first that is as near is compared.
NEIGHBOURS = (10, 20, 50, 100, 200)
# Noise, and tolerance of the fit.
CASES = ((0.0, 2e-4), (1e-3, 2e-4))


def fields(name: str, folder: Path) -> Iterator[Row]:
    """A fit that divides its cells, beside scipy's `RBFInterpolator` at equal error."""
    count = PAIRS[name]
    for noise, tolerance in CASES:
        ours = run_process(child("fields", "fit", count, noise, tolerance), folder)
        for near in NEIGHBOURS:
            theirs = run_process(child("fields", near, count, noise, tolerance), folder)
            if theirs.value["error"] <= ours.value["error"]:
                break
        fit, other = ours.value, theirs.value
        data = f"noise {noise:g}" if noise else "exact data"
        yield Row(
            f"a field at {count:,} points, {data}: `fit` with `octree: {{depth: auto}}`",
            f"`RBFInterpolator`, {near} neighbours, at 20,000 points: {theirs.processor:.0f} s of "
            f"processors, {theirs.peak / 2**30:.1f} GiB, error {other['error']:.1e}",
            f"{ours.seconds:.0f} s, {ours.processor:.0f} s of processors, "
            f"{ours.peak / 2**30:.1f} GiB, error {fit['error']:.1e}; {fit['control_points']:,} "
            f"control points, residual {fit['rms']:.1e}; a solid follows exactly",
            "60 s, 4 GiB",
            (ours.seconds <= 60 and ours.peak <= 4 * 2**30) if name == "full" else None,
        )
