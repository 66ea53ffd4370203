"""Text of a report of `ffd deform`, as printed without `--json`."""

from __future__ import annotations

from typing import Any

from ffdcli.cli.fit_lines import residual_lines
from ffdcli.cli.folding_text import folding_text
from ffdcli.messages import amount_text


def summary(report: dict[str, Any]) -> str:
    """Lines that summarise a report: of a CAD file, a mesh or a dry run."""
    if "dry_run" in report:
        return _of_dry_run(report)
    if "mesh_mode" in report:
        text = _of_mesh(report)
    else:
        text = _of_part(report) if "part" in report else _of_cad(report)
    fits = [line for fit in report.get("fits", ()) for line in residual_lines(fit)]
    return "\n".join([text, *fits])


def parametrization_lines(report: dict[str, Any]) -> list[str]:
    """Lines on the time that parameters took, for `--profile`; none where none were needed."""
    if "parametrization" not in report:
        return []
    lines = [f"parameters of the vertices: {_solved(report['parametrization'])}"]
    fits = report["fit"]["lattices"] if "fit" in report else []
    for each in fits:
        which = f" of lattices[{each['lattice']}]" if len(fits) > 1 else ""
        lines.append(f"parameters for the fit{which}: {_solved(each['parametrization'])}")
    return lines


def _solved(spent: dict[str, Any]) -> str:
    return (
        f"{spent['points']:,} points in {spent['seconds']:.2f} s, "
        f"at most {_counted(spent['iterations'], 'iteration')} each"
    )


def _of_cad(report: dict[str, Any]) -> str:
    what = _counted(report["solids"], "solid") if report["solids"] else "open shell"
    degrees = ", ".join(
        f"{count} plane{'s' * (count > 1)}" if name == "plane" else f"{count} of degree {name}"
        for name, count in report["degrees"].items()
    )
    return (
        f"{report['output']}: {what}, {_counted(report['faces'], 'face')} ({degrees}), "
        f"{_counted(report['control_points'], 'control point')}, {amount_text(report['bytes'])}, "
        f"in {report['unit']}\n"
        f"{_bound(report)}\n"
        f"{folding_text(report['jacobian'])}"
    )


def _of_part(report: dict[str, Any]) -> str:
    unit, tolerance = report["unit"], report["largest_tolerance"]
    what = _counted(report["solids"], "solid") if report["solids"] else "open shell"
    shares = ", ".join(f"{count} {kind}" for kind, count in report["faces_by"].items() if count)
    if report["exact"]:
        bound = "exact: what the lattice reaches has an exact form"
    else:
        bound = (
            f"fitted: faces and edges are within {report['max_error']:.2e} {unit} of the deformed "
            f"part (measured at {report['samples']:,} points, a third added)"
        )
    return (
        f"{report['output']}: {what}, faces: {shares}, "
        f"{_counted(report['control_points'], 'control point')}, {amount_text(report['bytes'])}, "
        f"in {unit}\n"
        f"{bound}\n"
        f"largest tolerance: {tolerance['read']:.1e} {unit} as read, {tolerance['written']:.1e} "
        f"{unit} as written\n"
        f"{folding_text(report['jacobian'])}"
    )


def _bound(report: dict[str, Any]) -> str:
    """Line on the distance between the faces and the deformed mesh."""
    off = f"{max(report['plane_deviation'], 0):.1e} {report['unit']} (or rounding, if larger)"
    if report["exact"]:
        added = ""
        if "interpolation_error" in report:
            lost = f"{report['interpolation_error']:.1e} {report['unit']}"
            added = f"; interpolation adds rounding errors of at most {lost}"
        return f"exact: the faces are within {off} of the deformed mesh{added}"
    if report["max_error"] == 0:
        return (
            "flattened: planes are shared within the coplanar distance; the faces are within "
            f"{off} of the deformed mesh"
        )
    if "fit" in report:
        fit, unit = report["fit"], report["unit"]
        how = "fitted and reduced" if report["max_error"] > fit["bound"] else "fitted"
        return (
            f"{how}: the faces are within {report['max_error']:.2e} {unit} of the deformed mesh, "
            f"plus {off} (largest error of the fit: {fit['largest_found']:.2e} {unit} at "
            f"{fit['samples']:,} test points; the bound is a third higher{_bounds(fit)})"
        )
    return (
        f"reduced: the faces are within {report['max_error']:.2e} {report['unit']} of the exact "
        f"result (certified), which is within {off} of the deformed mesh"
    )


def _bounds(fit: dict[str, Any]) -> str:
    """The bound of each lattice, where several were fitted."""
    if len(fit["lattices"]) == 1:
        return ""
    each = [f"lattices[{one['lattice']}] {one['bound']:.2e}" for one in fit["lattices"]]
    return f"; {', '.join(each)}"


def _of_mesh(report: dict[str, Any]) -> str:
    what = "closed" if report["watertight"] else "open"
    exact = "deformed part" if "part" in report else "exact surface"
    return (
        f"{report['output']}: {what}, {_counted(report['triangles'], 'triangle')}, "
        f"{_counted(report['vertices'], 'vertex')}, {amount_text(report['bytes'])}, "
        f"in {report['unit']}\n"
        f"approximate: the {exact} is up to {report['max_deviation']:.2g} {report['unit']} "
        "away from the triangles (measured at many points)"
    )


def _of_dry_run(report: dict[str, Any]) -> str:
    if "part" in report:
        faces = report["faces_by"]
        fitted = f"{faces['fitted']} to be fitted"
        if faces["fitted"]:
            fitted += f" (within {report['fit_tolerance']:.2g} {report['unit']})"
        return (
            f"dry run: {_counted(report['faces'], 'face')}: {faces['unchanged']} unchanged, "
            f"{faces['exact']} exact, {fitted}\n"
            f"{folding_text(report['jacobian'])}"
        )
    return (
        f"dry run: {_counted(report['faces'], 'face')}, "
        f"{_counted(report['control_points'], 'control point')}, about "
        f"{amount_text(report['bytes'])} of {report['format']} in {report['seconds']:.0f} s\n"
        f"{_memory(report['memory'])}"
    )


def _memory(memory: dict[str, Any]) -> str:
    """Line on the memory that a run takes, and how much there is."""
    others = "".join(
        f" ({amount_text(needed)} with --writer {writer})"
        for writer, needed in memory["by_writer"].items()
        if needed != memory["needed"]
    )
    room = memory["available"]
    had = "no limit" if room is None else f"{amount_text(room)} can be had"
    return f"memory: about {amount_text(memory['needed'])}{others}; {had}"


def _counted(count: int, noun: str) -> str:
    plural = {"vertex": "vertices"}.get(noun, f"{noun}s")
    return f"{count} {noun if count == 1 else plural}"
