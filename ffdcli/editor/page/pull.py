"""Panel that pulls points of the model with the mouse, or by numbers (Hu et al. 2001)."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from ffdcli.arrays import Floats
from ffdcli.editor.page.desk import Desk, Edit
from ffdcli.editor.page.picking import POINT_HINT, number_text, numbers
from ffdcli.errors import FfdError

_HELP = (
    "Drag the model with the left mouse button: the point under it follows, and the rest as little "
    "as it can. A click only picks a point. Drag beside the model to turn the view."
)


class PullPanel:
    """Pulls the model; `pin` and `hold` say what stays."""

    title = "Pull the model"

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        gui = desk.server.gui
        self._rest: Floats | None = None
        self._held: list[Edit] = []
        self._start: Floats | None = None
        with gui.add_folder(self.title) as self.folder:
            gui.add_markdown(_HELP)
            self._from = gui.add_text("Point", "", hint=POINT_HINT)
            self._by = gui.add_text("Move by", "", hint="x, y, z: how far its image moves")
            pull = gui.add_button("Pull by these numbers", icon=viser.Icon.ARROW_UP_RIGHT)
            self._weights = gui.add_checkbox("Change weights, not points", False)
            hold = gui.add_button_group(
                "Holds", ("Hold the picked point", "Forget holds"), hint="What a drag leaves alone"
            )
            self._box = gui.add_text("Hold a box", "", hint="Its lowest and highest x, y, z")
            groups = tuple(desk.session.mesh.groups)
            self._group = gui.add_dropdown("Hold a group", ("none", *groups), visible=bool(groups))
            self._told = gui.add_markdown("")
        desk.press(pull, self._pull_by_numbers)
        desk.choose(hold, {"Hold the picked point": self._hold, "Forget holds": self._forget})
        desk.redrawn.append(self._redrawn)
        self._gizmo = desk.server.scene.add_transform_controls(
            "/pull",
            scale=0.18 * desk.session.size,
            disable_rotations=True,
            depth_test=False,
            visible=False,
        )
        self._gizmo.on_update(self._gizmo_moved)

    def show(self, active: bool) -> None:
        """Take the mouse, or give it back."""
        self.folder.visible = active
        self._desk.drag_model(self._dragged if active else None)
        self._gizmo.visible = active and self._rest is not None
        self._desk.picked.show(active)

    def click(self, origin: Floats, direction: Floats, _add: bool) -> None:
        """Pick the point of the model under the mouse."""
        self._desk.require_full()
        hit = self._desk.session.hit(origin, direction)
        if hit is not None:
            self._pick(hit.rest)

    def _pick(self, rest: Floats) -> None:
        self._desk.edit_lattice_at(rest)
        neat = np.array(self._desk.session.neat(rest))
        self._rest = neat
        self._from.value = number_text(neat)
        self._redrawn()
        self._gizmo.visible = True

    def _redrawn(self) -> None:
        session = self._desk.session
        self._weights.visible = session.weighted()
        points = [edit["point"] for edit in self._held]
        self._desk.holds.set(session.image(np.array(points, dtype=float).reshape(-1, 3)))
        if self._rest is not None:
            image = session.image(self._rest[None])[0]
            self._desk.picked.set(image[None])
            self._gizmo.position = image

    # The mouse on the model.

    async def _dragged(self, event: viser.SceneNodeDragEvent[Any]) -> None:
        start, end = np.array(event.start_position), np.array(event.end_position)
        eye = np.array(event.client.camera.position)
        if event.phase == "start":
            self._desk.worker.do(lambda: self._grab(eye, start))
        elif event.phase == "update":
            self._desk.worker.show(lambda: self._show(end - start))
        else:
            self._desk.worker.do(lambda: self._let_go(end - start))

    def _grab(self, eye: Floats, point: Floats) -> None:
        self._start = None
        self._desk.require_full()
        hit = self._desk.session.hit(eye, point - eye)
        if hit is None:
            raise FfdError("the mouse is not on the model", hint="begin on one of its faces")
        self._pick(hit.rest)
        self._gizmo.visible = False
        self._start = self._rest

    def _show(self, by: Floats) -> None:
        if self._start is not None:
            self._desk.show_preview(*self._edits(self._start, by))

    def _let_go(self, by: Floats) -> None:
        if self._start is None:
            return
        start, self._start = self._start, None
        self._gizmo.visible = True
        self._commit(start, by)

    # The handle at the picked point.

    async def _gizmo_moved(self, event: viser.TransformControlsEvent) -> None:
        position = np.array(event.target.position)
        if event.phase == "start":
            return
        if event.phase == "update":
            self._desk.worker.show(lambda: self._follow(position))
        else:
            self._desk.worker.do(lambda: self._settle(position))

    def _offset(self, position: Floats) -> Floats:
        return position - self._desk.session.image(self._picked()[None])[0]

    def _follow(self, position: Floats) -> None:
        self._desk.show_preview(*self._edits(self._picked(), self._offset(position)))

    def _settle(self, position: Floats) -> None:
        self._commit(self._picked(), self._offset(position))

    # Numbers.

    def _pull_by_numbers(self) -> None:
        rest = np.array(numbers(self._from.value, 3, "Point"))
        by = np.array(numbers(self._by.value, 3, "Move by"))
        self._rest = rest
        self._desk.require_full()
        self._desk.commit(*self._edits(rest, by, neat=False))
        self._desk.say(f"Pulled the point {number_text(rest)} by {number_text(by)}.")

    def _commit(self, rest: Floats, by: Floats) -> None:
        edits = self._edits(rest, by)
        self._by.value = number_text(self._desk.session.neat(by))
        self._desk.commit(*edits)

    def _edits(self, rest: Floats, by: Floats, *, neat: bool = True) -> list[Edit]:
        session = self._desk.session
        step = np.array(session.neat(by)) if neat else by
        if not step.any():
            return []
        return session.drag(
            rest[None],
            by=step[None],
            pin=session.selectors(self._desk.pins[session.active]),
            hold=self._holds(),
            plane=self._desk.plane(),
            vary="weights" if self._weights.value and session.weighted() else "points",
        )

    # What stays.

    def _picked(self) -> Floats:
        if self._rest is None:
            raise FfdError("no point of the model is picked", hint="click on the model")
        return self._rest

    def _holds(self) -> list[Edit]:
        found = list(self._held)
        if self._group.value != "none":
            found.append({"group": self._group.value})
        if self._box.value.strip():
            low_high = numbers(self._box.value, 6, "Hold a box")
            found.append({"inside": {"min": low_high[:3], "max": low_high[3:]}})
        return found

    def _hold(self) -> None:
        self._held.append({"point": self._desk.session.neat(self._picked())})
        self._tell()

    def _forget(self) -> None:
        self._held.clear()
        self._group.value, self._box.value = "none", ""
        self._tell()

    def _tell(self) -> None:
        self._told.content = f"{len(self._held)} points are held." if self._held else ""
        self._redrawn()
