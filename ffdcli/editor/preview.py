"""Where drawn vertices would be after an edit, fast enough for each movement of a mouse.

A drag is linear in the displacements of its points, and so are moves in theirs: what one unit of
displacement does to each vertex is computed once, and then scaled. A transformation of control
points is affine, and needs four such fields. What is neither is applied as it is, and the changed
control points are multiplied with the kept functions.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.editor.basis import Functions, Reach
from ffdcli.editor.making import mask_of
from ffdcli.editor.stages import Stages
from ffdcli.errors import LatticeError
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.edit.point_maps import transform
from ffdcli.lattice.file.problems import AXES

# Pairs of a drag that each have a field; drags of more are made as they are.
_MOST_PAIRS = 16


@dataclass(frozen=True, eq=False)
class Preview:
    """Drawn vertices and control points after edits that are not made yet.

    Parameters
    ----------
    vertices : (V, 3) float64, model length
    nets : tuple of (m, 3) float64, model length
        Control points of each lattice.
    """

    vertices: Floats
    nets: tuple[Floats, ...]


@dataclass(frozen=True, eq=False)
class Fields:
    """What units of movement do.

    Parameters
    ----------
    control : (n, k) float64
        To the control points of a lattice.
    drawn : (r, k) float64
        To the drawn vertices that it deforms.
    """

    control: Floats
    drawn: Floats


@dataclass(frozen=True, eq=False)
class Movement:
    """An edit as a linear movement.

    Parameters
    ----------
    key : str
        Equal for edits with equal fields.
    units : (k, 3) float64, lattice frame
        How much of each field.
    """

    key: str
    units: Floats


class Previews:
    """Previews of edits of one lattice as it is.

    Parameters
    ----------
    stages : Stages
    number : int
        Of the lattice.
    lattice : BoxLattice
    functions : Functions
    reach : Reach
        With the weights of the lattice.
    vertices : (V, 3) float64, model length
        All drawn vertices as they are.
    """

    def __init__(
        self,
        stages: Stages,
        number: int,
        lattice: BoxLattice,
        functions: Functions,
        reach: Reach,
        vertices: Floats,
    ) -> None:
        self.stages, self.number, self.lattice = stages, number, lattice
        self.functions, self.reach, self.vertices = functions, reach, vertices
        self.frame = lattice.map.frame
        self.net = self.frame.to_model(lattice.points.reshape(-1, 3))
        self._fields: dict[str, Fields] = {}
        self._starts: dict[str, Floats] = {}

    def of(self, edits: Sequence[dict[str, Any]]) -> tuple[Floats, Floats]:
        """Drawn vertices (V, 3) and control points (m, 3) after edits.

        Raises
        ------
        LatticeError
            As when the edits are made. Edits like those before, with other displacements, are not
            checked again.
        """
        movements = self._movements(edits)
        if movements is None:
            return self.of_lattice(self._made(edits))
        if any(each.key not in self._fields for each in movements):
            # Errors are those of the edits as they are.
            after = self._made(edits)
            if not self._add_fields(edits, movements):
                return self.of_lattice(after)
        net, vertices, rows = self.net.copy(), self.vertices.copy(), self.functions.rows
        for each in movements:
            fields, units = self._fields[each.key], self.frame.turn_to_model(each.units)
            net += fields.control @ units
            vertices[rows] += fields.drawn @ units
        if len(off := self.functions.off):
            vertices[rows[off]] = self.functions.images_beyond(self._made(edits))
        return vertices, net

    def of_lattice(self, after: BoxLattice) -> tuple[Floats, Floats]:
        """Drawn vertices (V, 3) and control points (m, 3) with other control points."""
        rows = self.functions.rows
        net = self.frame.to_model(after.points.reshape(-1, 3))
        vertices = self.vertices.copy()
        if after.control.at_rest is not self.lattice.control.at_rest:
            # Other knots.
            functions = Functions.of(after.map, rows, self.functions.places + self.functions.beyond)
            vertices[rows] = functions.images(after)
        elif not np.array_equal(after.weights, self.lattice.weights):
            vertices[rows] = self.functions.images(after)
        else:
            moves = (after.points - self.lattice.points).reshape(-1, 3)
            vertices[rows] += self.frame.turn_to_model(self.reach.sums(moves))
            vertices[rows[self.functions.off]] = self.functions.images_beyond(after)
        return vertices, net

    def _made(self, edits: Sequence[dict[str, Any]]) -> BoxLattice:
        return self.stages.extended(self.number, self.lattice, edits)

    def _movements(self, edits: Sequence[dict[str, Any]]) -> list[Movement] | None:
        """The edits as movements; None where one of them is none."""
        found = []
        for edit in edits:
            try:
                each = self._movement(edit)
            except (KeyError, TypeError, ValueError, AttributeError):
                # What is no edit is refused, with a sentence, where it is made.
                return None
            if each is None:
                return None
            found.append(each)
        kinds = {next(iter(edit)) for edit in edits}
        # Movements of several kinds add up unless one depends on where another has moved points.
        alone = len(edits) > 1 and ("transform" in kinds or _has_targets(edits))
        return None if alone else found

    def _movement(self, edit: dict[str, Any]) -> Movement | None:
        ((name, value),) = edit.items()
        if name == "move" and "to" not in value:
            rest = {key: each for key, each in value.items() if key != "by"}
            return Movement(json.dumps([name, rest]), _vectors([value["by"]]))
        if name == "transform":
            rest = {"at": value["at"]}
            return Movement(json.dumps([name, rest]), self._affine(value))
        if name != "drag" or isinstance(value["pairs"], str):
            return None
        if len(value["pairs"]) > _MOST_PAIRS or value.get("vary") == "weights":
            return None
        if any("rigid" in each for each in value.get("hold", ())):
            return None
        sources = [pair["from"] for pair in value["pairs"]]
        key = json.dumps([name, {**value, "pairs": sources}])
        by = _vectors([pair.get("by", pair.get("to")) for pair in value["pairs"]])
        targets = np.array(["to" in pair for pair in value["pairs"]])
        if targets.any():
            if key not in self._starts:
                self._starts = {key: self._image(_vectors(sources))}
            by = by - targets[:, None] * self._starts[key]
        return Movement(key, by if self.frame.aligned else by @ self.frame.axes.T)

    def _affine(self, value: dict[str, Any]) -> Floats:
        """The affine map (4, 3) of moves that a transformation makes of control points."""
        probes = np.concatenate([np.eye(3), np.zeros((1, 3))])
        turn, box = value.get("rotate"), self.lattice.layout.box
        centre = box.mean(axis=0)
        if value.get("center") is not None:
            (given,) = _vectors([value["center"]])
            centre = given - self.lattice.layout.written_origin
        moved = transform(
            probes,
            scale=_vectors([value.get("scale") or (1.0, 1.0, 1.0)])[0],
            rotation=(AXES.index(turn["axis"]), float(turn["angle"])) if turn else None,
            translate=_vectors([value.get("translate") or (0.0, 0.0, 0.0)])[0],
            centre=centre,
        )
        return np.concatenate([moved[:3] - moved[3] - np.eye(3), moved[3:]])

    def _image(self, points: Floats) -> Floats:
        """Images (m, 3) of model points (m, 3) of the box."""
        return self.frame.to_model(self.lattice.map.evaluate(self.frame.to_local(points)))

    def _add_fields(self, edits: Sequence[dict[str, Any]], movements: Sequence[Movement]) -> bool:
        """Make the fields of movements; False where that is not possible."""
        found = {}
        for edit, movement in zip(edits, movements, strict=True):
            control = self._control(edit, len(movement.units))
            if control is None:
                return False
            found[movement.key] = Fields(control, self.reach.sums(control))
        # Those of other movements are not needed any more.
        self._fields = found
        return True

    def _control(self, edit: dict[str, Any], count: int) -> Floats | None:
        """Coefficients (n, k) of control points: what one unit of displacement moves them by."""
        ((name, value),) = edit.items()
        if name != "drag":
            chosen = mask_of(self.lattice, [value["at"]])
            if (chosen & self.lattice.locked.ravel()).any():
                # Whether locked control points are displaced depends on the numbers.
                return None
            mask = chosen[:, None].astype(np.float64)
            points = self.lattice.points.reshape(-1, 3)
            return mask if name == "move" else np.hstack([mask * points, mask])
        box = self.lattice.layout.box
        size = 2.0 ** np.round(np.log2(np.linalg.norm(box[1] - box[0])))
        columns = []
        for number in range(count):
            pairs = [
                {"from": pair["from"], "by": (size * (n == number) * self.frame.axes[0]).tolist()}
                for n, pair in enumerate(value["pairs"])
            ]
            try:
                after = self._made([{"drag": {**value, "pairs": pairs}}])
            except LatticeError:
                return None
            columns.append((after.points - self.lattice.points).reshape(-1, 3)[:, 0] / size)
        return np.stack(columns, axis=1)


def _has_targets(edits: Sequence[dict[str, Any]]) -> bool:
    pairs = [pair for edit in edits for pair in edit.get("drag", {}).get("pairs", ())]
    return any("to" in pair for pair in pairs)


def _vectors(values: Sequence[Any]) -> Floats:
    """Vectors (k, 3) of finite numbers.

    Raises
    ------
    ValueError
        They are others.
    """
    found = np.array(values, dtype=np.float64)
    if found.shape != (len(values), 3) or not np.isfinite(found).all():
        raise ValueError("no vectors")
    return found
