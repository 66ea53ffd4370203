"""Rows about very large meshes: time and memory per facet, of our own stages and of whole runs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cases
from measure import FFD, Row, run_process

# Facets: 20 times the squares of these.
FREQUENCIES = {"full": (22, 224), "small": (2, 5)}
SPHERES = {"full": 32, "small": 3}
# Diagonal of the scan, about; tolerances are relative to it.
DIAGONAL = 350.0


def million(name: str, folder: Path) -> Iterator[Row]:
    """A scan-like mesh of a million facets by `--writer direct`, and one of ten thousand."""
    start = run_process([*FFD, "deform", *cases.scan_files(folder, 1), *_how("start", [])], folder)
    for what, how in (
        ("exact", []),
        ("--tolerance 1e-6 × size", ["--tolerance", repr(1e-6 * DIAGONAL)]),
    ):
        runs = {}
        for frequency in FREQUENCIES[name]:
            mesh, lattice = cases.scan_files(folder, frequency)
            target = f"scan-{frequency}"
            run = run_process([*FFD, "deform", mesh, lattice, *_how(target, how)], folder)
            (folder / f"{target}.step").unlink()
            runs[20 * frequency**2] = run
        few, many = runs
        each = {
            count: 1e3 * (run.processor - start.processor) / count for count, run in runs.items()
        }
        report, run = runs[many].value, runs[many]
        growth = each[many] / each[few]
        yield Row(
            f"`ffd deform --writer direct`, scan of {many:,} facets, degree 2, {what}",
            f"{few:,} facets",
            f"own check on: {run.seconds:.0f} s, {run.processor:.0f} s of processors, "
            f"{run.peak / 2**30:.1f} GiB; {report['bytes'] / 1e9:.2f} GB, "
            f"{report['control_points']:,} control points; "
            f"{each[many]:.2f} ms a facet beyond start-up, {growth:.2f}×",
            "20 minutes, 12 GiB, 1.3×",
            (run.seconds <= 1200 and run.peak <= 12 * 2**30 and growth <= 1.3)
            if name == "full"
            else None,
        )


def _how(target: str, options: list[str]) -> list[str]:
    return ["-o", f"{target}.step", "--writer", "direct", "--quiet", "--json", *options]


def verified(name: str, folder: Path) -> Iterator[Row]:
    """Processor time of `ffd verify` against that of `ffd deform`, which made the file."""
    mesh, lattice = cases.sphere_files(folder, SPHERES[name])
    twisted = folder / "degree-2.yaml"
    twisted.write_text(
        "version: 1\ndegree: [2, 2, 2]\npoints: [6, 6, 6]\nedits:\n- twist: {axis: w, angle: 40}\n"
    )
    for what, file in (("degree 2", twisted), ("degree 3", lattice)):
        target = f"{file.stem}.step"
        arguments = [*FFD, "deform", mesh, file, "-o", target, "--quiet", "--json"]
        direct = run_process([*arguments, "--writer", "direct"], folder)
        made = run_process(arguments, folder)
        run = run_process([*FFD, "verify", target, mesh, file, "--quiet", "--json"], folder)
        yield Row(
            f"`ffd verify`, sphere of {made.value['faces']:,} faces, lattice of {what}",
            f"`ffd deform` of the file ({made.processor:.1f} s of processors; "
            f"`--writer direct` {direct.processor:.1f} s)",
            f"{run.processor / made.processor:.2f}× ({run.processor:.1f} s of processors, "
            f"{run.seconds:.1f} s by the clock); {run.processor / direct.processor:.1f}× of "
            f"`--writer direct`; {'passed' if run.value['passed'] else 'FAILED'}",
            "at most 1×",
            run.processor <= made.processor and run.value["passed"] if name == "full" else None,
        )
