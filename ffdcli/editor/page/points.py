"""Panel that selects control points and moves, turns and scales them."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from ffdcli.arrays import Bools, Floats
from ffdcli.editor.page.desk import Desk, Edit
from ffdcli.editor.page.picking import (
    inside_rectangle,
    number_text,
    numbers,
    turn_about_axis,
    turn_matrix,
    turn_quaternion,
)
from ffdcli.editor.page.scene import SELECTED, rgb8
from ffdcli.errors import FfdError

_HELP = (
    "Click a control point; with Shift another joins. Drag a box around many with Shift held. "
    "Then move or turn them by the handle, scale them by the ball."
)
_AXES = ("u", "v", "w")
# Distance from the mouse within which a control point is hit, and place and size of the ball, over
# the size of the model.
_NEAR, _HANDLE, _BALL = 0.02, 0.2, 0.012


class PointsPanel:
    """Control points: selection, pins, handle and numbers."""

    title = "Move control points"

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        gui, size = desk.server.gui, desk.session.size
        with gui.add_folder(self.title) as self.folder:
            gui.add_markdown(_HELP)
            self._axis = gui.add_dropdown("Layers along", _AXES)
            self._layer = gui.add_number("Layer", 0, step=1, hint="0 is the first, -1 the last")
            layer = gui.add_button_group("Select", ("Layer", "All", "None", "Others"))
            self._add = gui.add_checkbox("Add to the selection", False)
            self._told = gui.add_markdown("No control point is selected.")
            pin = gui.add_button_group(
                "Pins", ("Pin", "Unpin", "Unpin all"), hint="Pinned points stay when you pull"
            )
            self._by = gui.add_text("Move by", "", hint="x, y, z")
            self._turn = gui.add_text("Turn by", "", hint="Degrees about the axis below")
            self._about = gui.add_dropdown("Turn about", _AXES, initial_value="w")
            self._scale = gui.add_text("Scale by", "", hint="One factor, or three along u, v, w")
            apply = gui.add_button("Apply these numbers", icon=viser.Icon.CHECK)
            self._weight = gui.add_text("Weight", "1")
            self._weigh_button = gui.add_button("Set the weight")
        desk.choose(
            layer,
            {
                "Layer": self._select_layer,
                "All": lambda: self._select(~self._mask()),
                "None": lambda: self._select(np.zeros_like(self._mask()), add=False),
                "Others": lambda: self._select(~self._mask(), add=False),
            },
        )
        desk.choose(
            pin,
            {
                "Pin": lambda: self._pin(self._mask(), True),
                "Unpin": lambda: self._pin(self._mask(), False),
                "Unpin all": lambda: self._pin(np.ones_like(self._mask()), False),
            },
        )
        desk.press(apply, self._apply)
        desk.press(self._weigh_button, self._weigh)
        desk.redrawn.append(self._redrawn)
        scene = desk.server.scene
        self._centre = np.zeros(3)
        self._start: tuple[Floats, Floats] | None = None
        self._active = False
        self._gizmo = scene.add_transform_controls(
            "/points", scale=0.18 * size, depth_test=False, visible=False
        )
        self._gizmo.on_update(self._gizmo_moved)
        self._ball = scene.add_icosphere(
            "/scale", radius=_BALL * size, color=rgb8(SELECTED), visible=False, cast_shadow=False
        )
        self._ball.on_drag("left")(self._ball_dragged)

    # The mouse.

    def show(self, active: bool) -> None:
        """Take the mouse, or give it back."""
        self.folder.visible = self._active = active
        scene = self._desk.server.scene
        if active:
            scene.on_rect_select(modifier="shift")(self._boxed)
        else:
            scene.remove_rect_select_callback(self._boxed)
        self._redrawn()

    def click(self, origin: Floats, direction: Floats, add: bool) -> None:
        """Select the control point under the mouse."""
        self._desk.require_full()
        session = self._desk.session
        found = session.near_mask(origin, direction, _NEAR * session.size)
        if found.any():
            self._select(found, add=add or None)

    async def _boxed(self, event: viser.SceneRectSelectEvent) -> None:
        camera = event.client.camera
        view: dict[str, Any] = {
            "position": np.array(camera.position),
            "wxyz": np.array(camera.wxyz),
            "fov": float(camera.fov),
            "aspect": float(camera.aspect),
        }
        low, high = event.screen_min, event.screen_max

        def select() -> None:
            session = self._desk.session
            net = session.nets[session.active]
            seen = inside_rectangle(net.points, low, high, **view)
            self._select(seen & (~net.hidden | self._desk.see["hidden"]))

        self._desk.worker.do(select)

    # Selection.

    def _mask(self) -> Bools:
        return self._desk.selected[self._desk.session.active]

    def _select(self, mask: Bools, *, add: bool | None = None) -> None:
        """Select control points, beside those selected if ``add`` or the tick box says so."""
        beside = self._add.value if add is None else add
        active = self._desk.session.active
        self._desk.selected[active] = mask | self._mask() if beside else mask.copy()
        self._desk.redraw()

    def _select_layer(self) -> None:
        self._select(self._desk.session.slice_mask(self._axis.value, int(self._layer.value)))

    def _pin(self, mask: Bools, pinned: bool) -> None:
        active = self._desk.session.active
        pins = self._desk.pins[active]
        self._desk.pins[active] = pins | mask if pinned else pins & ~mask
        self._desk.redraw()

    def _redrawn(self) -> None:
        session, mask = self._desk.session, self._mask()
        count = int(mask.sum())
        net = session.nets[session.active]
        locked, pins = int((mask & net.locked).sum()), int(self._desk.pins[session.active].sum())
        parts = [f"{count} of {len(mask)} control points are selected"]
        parts += [f"{locked} of them locked, which stay"] if locked else []
        parts += [f"{pins} pinned"] if pins else []
        self._told.content = ", ".join(parts) + "."
        shown = self._active and count > 0
        self._weight.visible = self._weigh_button.visible = session.weighted()
        if shown:
            free = mask & ~net.locked
            self._centre = net.points[free if free.any() else mask].mean(axis=0)
            self._gizmo.position = self._centre
            self._gizmo.wxyz = turn_quaternion(self._axes().T)
            self._ball.position = self._centre + _HANDLE * session.size * self._diagonal()
        self._gizmo.visible = self._ball.visible = shown

    def _axes(self) -> Floats:
        """Unit vectors along u, v, w, as rows."""
        return self._desk.frame.axes

    def _diagonal(self) -> Floats:
        return self._axes().sum(axis=0) / np.sqrt(3)

    # Handle and ball.

    async def _gizmo_moved(self, event: viser.TransformControlsEvent) -> None:
        position, wxyz = np.array(event.target.position), np.array(event.target.wxyz)
        if event.phase == "start":
            self._desk.worker.do(self._desk.require_full)
        elif event.phase == "update":
            self._desk.worker.show(lambda: self._desk.show_preview(*self._moved(position, wxyz)))
        else:
            self._desk.worker.do(lambda: self._desk.commit(*self._moved(position, wxyz)))

    def _moved(self, position: Floats, wxyz: Floats) -> list[Edit]:
        """The edits of a handle that was moved, or turned about one of its axes."""
        session, axes = self._desk.session, self._axes()
        step = np.array(session.neat(axes @ (position - self._centre)))
        axis, degrees = turn_about_axis(axes @ turn_matrix(wxyz))
        degrees = round(degrees, 3)
        if degrees:
            return self._transform(rotate=(_AXES[axis], degrees))
        return self._move(step) if step.any() else []

    async def _ball_dragged(self, event: viser.SceneNodeDragEvent[Any]) -> None:
        start, end = np.array(event.start_position), np.array(event.end_position)

        def edits() -> list[Edit]:
            before, now = start - self._centre, end - self._centre
            factor = float(np.dot(before, now) / np.dot(before, before))
            factor = round(max(factor, 0.01), 3)
            return self._transform(scale=[factor] * 3) if factor != 1 else []

        if event.phase == "update":
            self._desk.worker.show(lambda: self._desk.show_preview(*edits()))
        elif event.phase == "end":
            self._desk.worker.do(lambda: self._desk.commit(*edits()))

    # Edits.

    def _move(self, by: Floats) -> list[Edit]:
        return self._desk.session.move(self._chosen(), by, plane=self._desk.plane())

    def _transform(self, **parts: Any) -> list[Edit]:
        session = self._desk.session
        centre = session.neat(self._desk.written(self._centre))
        return session.transform(self._chosen(), **parts, center=centre, plane=self._desk.plane())

    def _chosen(self) -> Bools:
        """The selected control points that may move: an edit of locked ones is refused."""
        session = self._desk.session
        free = self._mask() & ~session.nets[session.active].locked
        if not self._mask().any():
            raise FfdError("no control point is selected", hint="click one, or select a layer")
        if not free.any():
            raise FfdError(
                "the border locks all selected control points",
                hint="select others, or change `border` in the lattice file",
            )
        return free

    def _apply(self) -> None:
        parts: dict[str, Any] = {}
        if self._scale.value.strip():
            words = len(self._scale.value.replace(",", " ").split())
            factors = numbers(self._scale.value, 1 if words == 1 else 3, "Scale by")
            parts["scale"] = factors * 3 if words == 1 else factors
        if self._turn.value.strip():
            parts["rotate"] = (self._about.value, numbers(self._turn.value, 1, "Turn by")[0])
        by = numbers(self._by.value, 3, "Move by") if self._by.value.strip() else None
        self._desk.require_full()
        if parts:
            self._desk.commit(*self._transform(**parts, translate=by))
        elif by is not None:
            self._desk.commit(*self._move(np.array(by)))
        else:
            raise FfdError("there is no number to apply", hint="fill in one of the fields above")

    def _weigh(self) -> None:
        value = numbers(self._weight.value, 1, "Weight")[0]
        self._desk.commit(
            *self._desk.session.weight(self._chosen(), value, plane=self._desk.plane())
        )
        self._desk.say(f"The weight of the selected points is {number_text(value)}.")
