"""The verdict on folds in words, the same for `ffd deform` and `ffd info`."""

from __future__ import annotations

from typing import Any


def folding_text(jacobian: dict[str, Any]) -> str:
    """Line on whether the lattice folds the model over, from the `jacobian` of a report."""
    if jacobian["injective"] == "no":
        place = ", ".join(f"{x:.6g}" for x in jacobian["at"])
        folded = jacobian["folded"]
        return (
            f"folded over: det J is {jacobian['value']:.3g} at ({place}); "
            f"{folded['share']:.2%} of the surface is folded, by {folded['samples']:,} points"
            f"{_largest(jacobian)}"
        )
    if jacobian["injective"] == "unproved":
        return "folding cannot be ruled out"
    sense = "-det J" if jacobian.get("mirrored") else "det J"
    proved = f"no folds: {sense} is at least {jacobian['bound']:.3g} in the model"
    if jacobian["global"] == "yes":
        return f"{proved}, and no two points coincide"
    return f"{proved}; collisions of distant parts cannot be ruled out"


def _largest(jacobian: dict[str, Any]) -> str:
    if not jacobian.get("scale"):
        return ""
    return f"; scaled by up to {jacobian['scale']:.4g} the field does not fold it"


def scale_text(scale: dict[str, Any]) -> str:
    """Line on how far edits can be scaled, from `injective_scale` of a report."""
    proved, folds = scale["proved"], scale["folds"]
    known = f"proved up to {proved:.4g}"
    if proved == 0:
        known = "nothing proved: the effort allowed was spent"
    elif not scale["complete"]:
        known += ", unproved above: the effort allowed was spent"
    if folds is None:
        return f"{known}; no folds found"
    place = ", ".join(f"{x:.6g}" for x in scale["at"])
    return f"{known}; folds at {folds:.4g}, at ({place})"
