"""What `ffd deform` says of a run to people."""

from __future__ import annotations

from typing import Any


def summary(report: dict[str, Any]) -> str:
    """The lines for people of any report of `ffd deform`."""
    if "dry_run" in report:
        return _of_dry_run(report)
    return _of_mesh(report) if "mesh_mode" in report else _of_cad(report)


def _of_cad(report: dict[str, Any]) -> str:
    what = _counted(report["solids"], "solid") if report["solids"] else "open shell"
    degrees = ", ".join(
        f"{count} plane{'s' * (count > 1)}" if name == "plane" else f"{count} of degree {name}"
        for name, count in report["degrees"].items()
    )
    return (
        f"{report['output']}: {what}, {_counted(report['faces'], 'face')} ({degrees}), "
        f"{_counted(report['control_points'], 'control point')}, {_amount(report['bytes'])}, "
        f"in {report['unit']}\n"
        f"{_bound(report)}\n"
        f"{_folding(report['jacobian'])}"
    )


def _bound(report: dict[str, Any]) -> str:
    """One line on how far the faces are from the deformed mesh."""
    off = f"{max(report['plane_deviation'], 0):.1e} {report['unit']} or rounding"
    if report["exact"]:
        return f"exact: faces follow the deformed mesh to {off}, whichever is larger"
    if "fit" in report:
        fit, unit = report["fit"], report["unit"]
        how = "fitted and reduced" if report["max_error"] > fit["bound"] else "fitted"
        return (
            f"{how}: within {report['max_error']:.2e} {unit} of the deformed mesh (the fit is off "
            f"{fit['largest_found']:.2e} {unit} or less at {fit['samples']:,} points kept apart; a "
            f"third is added), and that to {off}, whichever is larger"
        )
    return (
        f"reduced: within {report['max_error']:.2e} {report['unit']} of the exact result "
        f"(certified), which follows the deformed mesh to {off}, whichever is larger"
    )


def _of_mesh(report: dict[str, Any]) -> str:
    what = "closed" if report["watertight"] else "open"
    return (
        f"{report['output']}: {what}, {_counted(report['triangles'], 'triangle')}, "
        f"{_counted(report['vertices'], 'vertex')}, {_amount(report['bytes'])}, "
        f"in {report['unit']}\n"
        f"approximate: the exact surface is up to {report['max_deviation']:.2g} {report['unit']} "
        "from the triangles (sampled densely)"
    )


def _of_dry_run(report: dict[str, Any]) -> str:
    return (
        f"dry run: {_counted(report['faces'], 'face')}, "
        f"{_counted(report['control_points'], 'control point')}, about "
        f"{_amount(report['bytes'])} of {report['format']} in {report['seconds']:.0f} s"
    )


def _folding(jacobian: dict[str, Any]) -> str:
    """One line on injectivity."""
    if jacobian["injective"] == "no":
        place = ", ".join(f"{x:.6g}" for x in jacobian["at"])
        return f"folded over: det J is {jacobian['value']:.3g} at ({place}), maybe elsewhere too"
    if jacobian["injective"] == "unproved":
        return "not proved that nothing is folded over"
    sense = "-det J" if jacobian.get("mirrored") else "det J"
    proved = f"nothing is folded over: {sense} is at least {jacobian['bound']:.3g} in the model"
    if jacobian["global"] == "yes":
        return f"{proved}, and no two points of it meet"
    return f"{proved}; not proved that parts far apart do not meet"


def _amount(size: int) -> str:
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.0f} kB"


def _counted(count: int, noun: str) -> str:
    plural = {"vertex": "vertices"}.get(noun, f"{noun}s")
    return f"{count} {noun if count == 1 else plural}"
