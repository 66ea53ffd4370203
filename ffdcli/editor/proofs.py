"""Whether a lattice folds the model, and how far an edit may go until that is not excluded."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.editor.making import neat
from ffdcli.folds.certificate import certify
from ffdcli.folds.model import ModelInBox
from ffdcli.folds.verdict import judge
from ffdcli.lattice import Lattice
from ffdcli.lattice.box_lattice import BoxLattice

# Halvings of the part of an edit that is in doubt.
_HALVINGS = 7


@dataclass(frozen=True, eq=False)
class Folds:
    """Whether the model is folded, and where.

    Parameters
    ----------
    verdict : {"yes", "no", "unproved"}
        Whether the deformation is injective.
    points, rest : (k, 3) float64, model length
        Sample points where it is folded, as they are and before the deformation.
    message : str
        A sentence.
    """

    verdict: Literal["yes", "no", "unproved"]
    points: Floats
    rest: Floats
    message: str


@dataclass(frozen=True, eq=False)
class Stop:
    """How far an edit goes.

    Parameters
    ----------
    share : float
        From 0 to 1: up to what share of it the model is proved not to fold.
    edits : list of mappings
        The edits at that share; none where it is 0.
    message : str
        A sentence; empty where the whole edit is proved.
    """

    share: float
    edits: list[dict[str, Any]]
    message: str


def folds_of(lattice: Lattice, models: Sequence[ModelInBox]) -> Folds:
    """The verdict on a lattice and a model, and the samples that are folded."""
    verdict = judge(lattice, models)
    rest, points = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for member, model in zip(lattice.members, models, strict=True):
        if model.empty:
            continue
        sense = -1 if verdict.mirrored else 1
        at = model.samples[sense * np.linalg.det(model.slopes(member.map)) < 0]
        frame = member.map.frame
        rest.append(frame.to_model(at))
        points.append(frame.to_model(member.map.evaluate(at)))
    if verdict.at is not None:
        owner = [m.map.contains(m.map.frame.to_local(verdict.at[None]))[0] for m in lattice.members]
        member = lattice.members[owner.index(True) if True in owner else 0]
        frame = member.map.frame
        rest.append(verdict.at[None])
        points.append(frame.to_model(member.map.evaluate(frame.to_local(verdict.at[None]))))
    message = verdict.problem or "It is proved that the lattice does not fold the model."
    return Folds(verdict.locally_injective, np.concatenate(points), np.concatenate(rest), message)


@dataclass(frozen=True, eq=False)
class Proof:
    """Whether a lattice is proved not to fold the model.

    Parameters
    ----------
    proved : bool
    mirrored : bool
        Whether it mirrors the model as a whole.
    """

    proved: bool
    mirrored: bool = False


def prove(lattice: BoxLattice, model: ModelInBox, before: BoxLattice | None = None) -> Proof:
    """Try to prove that a lattice does not fold the model.

    Parameters
    ----------
    lattice : BoxLattice
    model : ModelInBox
    before : BoxLattice, optional
        One that is proved, and does not mirror: only where the two differ is looked at.
    """
    one = lattice.map
    if model.empty:
        return Proof(True)
    if one.needs_fit:
        return Proof(bool(np.linalg.det(model.slopes(one)).min() > 0))
    if before is not None and before.control.at_rest is lattice.control.at_rest:
        changed = (lattice.points != before.points).any(axis=-1)
        changed |= lattice.weights != before.weights
        if not changed.any():
            return Proof(True)
        low, high = one.supports()
        moved = changed.ravel()
        box = np.stack([low[moved].min(axis=0), high[moved].max(axis=0)])
        model = replace(model, box=np.clip(box, model.box[0], model.box[1]))
        if model.empty:
            return Proof(True)
    sign = certify(one, model, may_mirror=before is None and not lattice.crossed)
    return Proof(sign.locally_injective == "yes", sign.sense < 0)


def last_proved(
    edits: Sequence[dict[str, Any]],
    after: Callable[[Sequence[dict[str, Any]]], BoxLattice],
    before: BoxLattice,
    model: ModelInBox,
    known: Proof,
    *,
    size: float,
) -> Stop:
    """The largest share of edits, within a hundredth, at which the model is proved not to fold.

    Parameters
    ----------
    edits : sequence of mappings
    after : callable
        The lattice with edits.
    before : BoxLattice
        Without them.
    model : ModelInBox
    known : Proof
        Of that one.
    size : float, model length
        That numbers are rounded by.

    Raises
    ------
    LatticeError
        The edits cannot be made.
    """
    near = before if known.proved and not known.mirrored else None

    if prove(after(edits), model, near).proved:
        return Stop(1.0, list(edits), "")
    if not known.proved:
        return Stop(0.0, [], "without the edit it is not proved either that nothing folds")
    low, high, best = 0.0, 1.0, list[dict[str, Any]]()
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        # The numbers that are judged are those of the edit that is made.
        some = scaled_edits(edits, middle, size)
        if some == list(edits):
            return Stop(0.0, [], "it is not proved that the edit folds nothing")
        if prove(after(some), model, near).proved:
            low, best = middle, some
        else:
            high = middle
    why = "it is not proved that nothing folds"
    if before.map.needs_fit:
        why = "samples of the model are folded (`embedding: inverse` allows no proof)"
    return Stop(low, best, f"stopped at {low:.0%} of the edit: beyond it {why}")


def scaled_edits(
    edits: Sequence[dict[str, Any]], share: float, size: float
) -> list[dict[str, Any]]:
    """Edits with a share of their displacements, angles and factors; others stay as they are.

    Numbers are rounded as a person would write them: lengths to a millionth of the size.
    """
    return [_scaled(edit, share, size) for edit in edits]


def _scaled(edit: dict[str, Any], share: float, size: float) -> dict[str, Any]:
    ((name, value),) = edit.items()
    if not isinstance(value, dict):
        return edit
    out = dict(value)
    if name == "drag" and not isinstance(value["pairs"], str):
        out["pairs"] = [_scaled({"move": pair}, share, size)["move"] for pair in value["pairs"]]
    elif name == "move" and value.get("by") is not None:
        out["by"] = neat(share * np.array(value["by"]), size)
    elif name == "transform":
        for key, rest, unit in (("scale", 1.0, 1.0), ("translate", 0.0, size)):
            if value.get(key) is not None:
                out[key] = neat(rest + share * (np.array(value[key]) - rest), unit)
        if value.get("rotate") is not None:
            out["rotate"] = {**value["rotate"], "angle": neat(share * value["rotate"]["angle"], 1)}
    elif name in ("twist", "bend"):
        out["angle"] = neat(share * value["angle"], 1)
    elif name == "taper":
        out["factor"] = neat(1 + share * (value["factor"] - 1), 1)
    elif name == "crimp":
        out["sharpness"] = neat(value["sharpness"] ** share, 1)
    return {name: out}
