"""The control net that the edits of a lattice file lead to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.lattice.border import Border
from ffdcli.lattice.drag.holds import Groups
from ffdcli.lattice.drag.requests import drag_by_edit
from ffdcli.lattice.drag.solutions import Succession
from ffdcli.lattice.edit.net_edits import bend, taper, transform, twist
from ffdcli.lattice.edit.peaks import crimp, find_peak, hammer, outward_normal
from ffdcli.lattice.file.definition import Definition
from ffdcli.lattice.file.drag_models import Drag
from ffdcli.lattice.file.edit_models import (
    BendEdit,
    Crimp,
    CrimpEdit,
    DragEdit,
    Hammer,
    HammerEdit,
    Move,
    MoveEdit,
    MoveKnotsEdit,
    NetEdit,
    ShiftedNet,
    TaperEdit,
    Transform,
    TransformEdit,
    TwistEdit,
    WeightEdit,
    WeightsEdit,
)
from ffdcli.lattice.file.pairs import PairTable
from ffdcli.lattice.file.problems import AXES, selector_problems
from ffdcli.lattice.file.selector_models import Numbered, Selector
from ffdcli.lattice.file.selectors import entry_indices, select
from ffdcli.lattice.file.source import KeyPath, Source
from ffdcli.lattice.file.spec import LatticeSpec
from ffdcli.lattice.layout import Interior, Layout, interior_fractions, map_at_rest
from ffdcli.lattice.locked import (
    describe_locked,
    require_locked_at_rest,
    require_locked_weights,
    why_locked,
)
from ffdcli.volume.adaptive.inverse_map import AnyMap

PointEdit = MoveEdit | TransformEdit | TwistEdit | TaperEdit | BendEdit | NetEdit


@dataclass(frozen=True)
class ControlNet:
    """Control points and weights, and the map at rest that they displace.

    Parameters
    ----------
    points, weights : (nu, nv, nw, 3), (nu, nv, nw) float64
        Control points, lattice frame, and their weights.
    interior : three float64 arrays
        Interior knots, as fractions of the box.
    at_rest : AnyMap
        The map with these knots and nothing displaced.
    """

    points: Floats
    weights: Floats
    interior: Interior
    at_rest: AnyMap


@dataclass(frozen=True)
class Solved:
    """What the edits lead to.

    Parameters
    ----------
    control : ControlNet
        Control points, weights and knots after all edits.
    map : AnyMap
        The map of that net.
    warnings : tuple of str
    successions : mapping of int to Succession
        Those drags, by the edit's number, that are successions of single-point drags.
    """

    control: ControlNet
    map: AnyMap
    warnings: tuple[str, ...]
    successions: Mapping[int, Succession]


def solve(
    definition: Definition,
    layout: Layout,
    border: Border,
    groups: Groups | None,
    surface: Floats,
) -> Solved:
    """Apply the edits of a checked lattice file, one after the other.

    Parameters
    ----------
    groups : mapping of str to (T, 3, 3) float64, or None
        Triangles of the mesh's groups, if they are known.
    surface : (T, 3, 3) float64, lattice frame
        The mesh's triangles.

    Raises
    ------
    LatticeError
        An edit selects nothing, displaces a locked control point that it names itself, moves
        knots that a locked control point rests on, or drags a point where it cannot go.
    """
    spec, source = definition.spec, definition.source
    interior = interior_fractions(spec)
    start = map_at_rest(spec, layout, interior)
    places = start.rest_points + layout.written_origin
    context = _Context(
        spec,
        source,
        layout,
        border,
        definition.nets,
        definition.pairs,
        groups,
        start,
        places,
        surface,
    )
    state = ControlNet(start.rest_points, start.rest_weights, interior, start)
    successions = {}
    warnings: list[str] = []
    if border.locked.all() and spec.edits:
        warnings.append(f"all control points are locked: {why_locked(border, border.crossed)}")
    for index, edit in enumerate(spec.edits):
        said: list[str] = []
        if isinstance(edit, HammerEdit):
            state = context.hammer(state, index, edit.hammer)
        elif isinstance(edit, CrimpEdit):
            state = context.crimp(state, index, edit.crimp)
        elif isinstance(edit, DragEdit):
            state, said, succession = context.drag(state, index, edit)
            if succession is not None:
                successions[index] = succession
        else:
            state, said = context.apply(state, index, edit)
        warnings.extend(said)
    with np.errstate(over="ignore"):
        volume = state.at_rest.with_control(state.points, state.weights)
    if not np.isfinite(volume.net).all():
        raise source.error(("edits",), "weights times coordinates are too large for numbers", None)
    return Solved(state, volume, tuple(warnings), successions)


@dataclass(frozen=True)
class _Context:
    """All that stays the same from edit to edit."""

    spec: LatticeSpec
    source: Source
    layout: Layout
    border: Border
    nets: Mapping[int, Floats]
    pairs: Mapping[int, PairTable]
    groups: Groups | None
    start: AnyMap
    # Places of the control points before any edit, in the coordinates of the edits.
    places: Floats
    surface: Floats

    def apply(
        self,
        state: ControlNet,
        index: int,
        edit: PointEdit | WeightEdit | WeightsEdit | MoveKnotsEdit,
    ) -> tuple[ControlNet, list[str]]:
        path: KeyPath = ("edits", index, next(iter(type(edit).model_fields)))
        if isinstance(edit, MoveKnotsEdit):
            axis = AXES.index(edit.move_knots.axis)
            values = np.array(edit.move_knots.values, dtype=np.float64)
            return self.move_knots(state, axis, values, path), []
        if isinstance(edit, (WeightEdit, WeightsEdit)):
            return self.weigh(state, index, edit, path), []
        named = isinstance(edit, (MoveEdit, TransformEdit, NetEdit))
        with np.errstate(over="ignore", invalid="ignore"):
            net = self.edited(state.points, index, edit, path)
        if not np.isfinite(net).all():
            raise self.source.error(path, "leads to coordinates too large for numbers", None)
        rest = state.at_rest.rest_points
        displaced, kept = require_locked_at_rest(net, rest, self.border, self.layout.box)
        if not displaced.any():
            return replace(state, points=kept), []
        if named:
            here = path if isinstance(edit, NetEdit) else (*path, "at")
            raise self.refusal(here, f"displaces {describe_locked(displaced, self.border)}")
        count = int(displaced.sum())
        said = f"edits[{index}].{path[-1]} leaves {count} locked control points where they are: "
        return replace(state, points=kept), [said + why_locked(self.border, self.border.crossed)]

    def edited(self, net: Floats, index: int, edit: PointEdit, path: KeyPath) -> Floats:
        box = self.layout.box
        if isinstance(edit, MoveEdit):
            return self.move(net, edit.move, path)
        if isinstance(edit, TransformEdit):
            return self.transform(net, edit.transform, path)
        if isinstance(edit, TwistEdit):
            return twist(net, box, AXES.index(edit.twist.axis), edit.twist.angle)
        if isinstance(edit, TaperEdit):
            return taper(net, box, AXES.index(edit.taper.axis), edit.taper.factor)
        if isinstance(edit, BendEdit):
            axis, toward = AXES.index(edit.bend.axis), AXES.index(edit.bend.toward)
            return bend(net, box, axis, toward, edit.bend.angle)
        origin = np.array(edit.net.origin) if isinstance(edit.net, ShiftedNet) else 0.0
        self.require_shape(self.nets[index][..., 0], path)
        return self.nets[index] + (origin - self.layout.written_origin)

    def move(self, net: Floats, move: Move, path: KeyPath) -> Floats:
        chosen = self.chosen(move.at, path)
        out = net.copy()
        if move.to is None:
            out[chosen] += np.array(move.by)
            return out
        if chosen.sum() > 1:
            message = f"`to` places one control point, but `at` selects {chosen.sum()}"
            raise self.source.error((*path, "to"), message, "select one, or use `by`")
        out[chosen] = np.array(move.to) - self.layout.written_origin
        return out

    def transform(self, net: Floats, edit: Transform, path: KeyPath) -> Floats:
        chosen = self.chosen(edit.at, path)
        centre = self.layout.box.mean(axis=0)
        if edit.center is not None:
            centre = np.array(edit.center) - self.layout.written_origin
        turn = edit.rotate
        out = net.copy()
        out[chosen] = transform(
            net[chosen],
            scale=np.array(edit.scale or (1.0, 1.0, 1.0)),
            rotation=(AXES.index(turn.axis), turn.angle) if turn else None,
            translate=np.array(edit.translate or (0.0, 0.0, 0.0)),
            centre=centre,
        )
        return out

    def exposed(self, at: Selector, path: KeyPath) -> Selector:
        """The selector, if it names no hidden control point and its numbers are there.

        What it means by place it takes from the exposed ones; what it means by number it says.
        """
        if isinstance(at, tuple):
            return at
        count = len(self.start.hidden)
        for place, message, hint in selector_problems(self.start.shape, at, path):
            raise self.source.error(place, message, hint)
        if isinstance(at, Numbered) and not at.hidden:
            named = entry_indices(at.index, count)
            hidden = named[self.start.hidden[named]]
            if len(hidden):
                message = f"control point {hidden[0]} is hidden: no cell round it holds the mesh"
                hint = "say `hidden: true` in the selector to edit it all the same"
                raise self.source.error((*path, "index"), message, hint)
        return at

    def chosen(self, at: Selector, path: KeyPath, key: str | int = "at") -> Bools:
        chosen = select(self.exposed(at, (*path, key)), self.places, self.start)
        if not chosen.any():
            every = self.places.reshape(-1, 3)
            low, high = every.min(axis=0), every.max(axis=0)
            hint = f"at rest they lie between {low.tolist()} and {high.tolist()}"
            raise self.source.error((*path, key), "selects no control point", hint)
        return chosen

    def require_shape(self, given: Floats, path: KeyPath) -> None:
        """How many control points an octree has is known only now."""
        if given.shape != self.start.shape:
            count = self.start.shape[0]
            message = f"holds {given.shape[0]} control points; for this mesh there are {count}"
            raise self.source.error(path, message, "use it with the mesh it was made for")

    def weigh(
        self, state: ControlNet, index: int, edit: WeightEdit | WeightsEdit, path: KeyPath
    ) -> ControlNet:
        if isinstance(edit, WeightEdit):
            weights = state.weights.copy()
            weights[self.chosen(edit.weight.at, path)] = edit.weight.value
            here: KeyPath = (*path, "at")
        else:
            weights, here = self.nets[index], path
            self.require_shape(weights, path)
        changed, kept = require_locked_weights(weights, self.start.rest_weights, self.border)
        if changed.any():
            locked = describe_locked(changed, self.border)
            raise self.refusal(here, f"changes the weight of {locked}")
        return replace(state, weights=kept)

    def drag(
        self, state: ControlNet, index: int, edit: DragEdit
    ) -> tuple[ControlNet, list[str], Succession | None]:
        path: KeyPath = ("edits", index, "drag")
        pinned = self.border.locked | self.start.hidden
        for number, selector in enumerate(edit.drag.pin):
            pinned |= self.chosen(selector, (*path, "pin"), number)
        done = drag_by_edit(
            state.at_rest,
            state.points,
            state.weights,
            edit.drag,
            self.pairs[index],
            pinned,
            self.groups,
            lambda place, message, hint: self.source.error((*path, *place), message, hint),
        )
        said = [f"edits[{index}].drag: {text}" for text in done.warnings]
        return replace(state, points=done.points, weights=done.weights), said, done.succession

    def free(self) -> Bools:
        """Control points that are neither locked nor hidden."""
        return ~(self.border.locked | self.start.hidden)

    def place(self, point: tuple[float, float, float], path: KeyPath) -> Floats:
        """A point of the object in the lattice frame."""
        place = self.layout.frame.to_local(np.array(point))
        if not self.start.contains(place[None])[0]:
            message = "the point lies outside the lattice box, where nothing moves"
            raise self.source.error((*path, "point"), message, "choose a point inside it")
        if not self.start.has_parameters(place[None])[0]:
            message = "the point has no parameters in the volume at rest"
            raise self.source.error((*path, "point"), message, "choose a point of the mesh")
        return place

    def hammer(self, state: ControlNet, index: int, edit: Hammer) -> ControlNet:
        path: KeyPath = ("edits", index, "hammer")
        rest = state.at_rest
        place = self.place(edit.point, path)
        peak = find_peak(rest, state.points, state.weights, place, self.free())
        if peak is not None:
            return replace(state, points=hammer(rest, state.points, peak, edit.height))
        normal = self.layout.frame.turn_to_model(outward_normal(self.surface, place))
        table = PairTable(np.array([edit.point]), edit.height * normal[None], np.array([True]))
        done = drag_by_edit(
            rest,
            state.points,
            state.weights,
            Drag.model_validate({"pairs": "hammer.csv"}),
            table,
            ~self.free(),
            None,
            lambda _, message, __: self.source.error(
                path, message, "choose a point that free control points reach, or more `points`"
            ),
        )
        return replace(state, points=done.points)

    def crimp(self, state: ControlNet, index: int, edit: Crimp) -> ControlNet:
        path: KeyPath = ("edits", index, "crimp")
        rest = state.at_rest
        place = self.place(edit.point, path)
        peak = find_peak(rest, state.points, state.weights, place, self.free())
        done = None
        if peak is not None:
            done = crimp(rest, state.points, state.weights, place, peak, edit.sharpness)
        if done is None:
            message = "there is no peak: no control point that reaches the point has moved it"
            raise self.source.error((*path, "point"), message, "raise one first, as with `hammer`")
        return replace(state, points=done[0], weights=done[1])

    def move_knots(self, state: ControlNet, axis: int, values: Floats, path: KeyPath) -> ControlNet:
        """Other knots under the same control points.

        A locked point must be at rest for the join to hold, and its place at rest follows the
        knots: so knots may move only where no locked point rests on them. Where other axes have
        crossed sides, that is nowhere.
        """
        parts = list(state.interior)
        parts[axis] = values
        interior = (parts[0], parts[1], parts[2])
        after = map_at_rest(self.spec, self.layout, interior)
        moved = np.any(state.at_rest.rest_points != after.rest_points, axis=-1)
        displaced = self.border.locked & moved
        if displaced.any():
            locked = describe_locked(displaced, self.border)
            raise self.refusal(path, f"moves the place at rest of {locked}")
        return replace(state, interior=interior, at_rest=after)

    def refusal(self, path: KeyPath, message: str) -> Exception:
        hint = (
            "choose other control points, more `points`, a larger `box`, or a lower `border` "
            "(c0 locks one layer)"
        )
        if self.spec.ends == "unclamped":
            hint = "choose other control points, more `points`, a larger `box`, or clamped `ends`"
        return self.source.error(path, message, hint)
