"""What the panels of the page share: session, scene, settings, and how edits are shown and made."""

from __future__ import annotations

import sys
import threading
import traceback
from collections.abc import Awaitable, Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import viser

from ffdcli.arrays import Bools, Floats
from ffdcli.editor.page import scene
from ffdcli.editor.page.worker import Job, Worker
from ffdcli.errors import FfdError
from ffdcli.messages import printable

if TYPE_CHECKING:
    from ffdcli.editor import Plane, Session
    from ffdcli.editor.drawn import Drawn
    from ffdcli.volume.frame import Frame

Edit = dict[str, Any]
Drag = Callable[[viser.SceneNodeDragEvent[Any]], Awaitable[None]]


# Polygons of a model beyond which the exact faces take so long that they are not drawn.
MOST_EXACT = 10_000


class Asked(Exception):
    """Work for rest ends: something is asked."""


class Desk:
    """The session as the page shows it.

    All changes of the session and the scene are jobs of one thread, the worker. Calls of the
    browser only ask for them, so that they come in order and the newest position of the mouse comes
    first.

    Parameters
    ----------
    session : Session
    server : ViserServer
    """

    def __init__(self, session: Session, server: viser.ViserServer) -> None:
        self.session, self.server = session, server
        self.worker = Worker(self.complain, self._rest)
        self.redrawn: list[Job] = []
        self.judged: Job = lambda: None
        self.saying: Callable[[str], None] = lambda text: None
        self.plane: Callable[[], Plane | None] = lambda: None
        self.stops: Callable[[], bool] = lambda: False
        self.share = 1.0
        self.selected: list[Bools] = [np.zeros(len(net.points), bool) for net in session.nets]
        self.pins: list[Bools] = [mask.copy() for mask in self.selected]
        self.see = {"now": True, "rest": False, "hidden": False, "exact": True}
        self.verdict = ""
        self._exact: Drawn | None = None
        self._judged_revision = -1
        self._previewing = False
        self._drag: Drag | None = None
        self._drawing = threading.RLock()
        size = session.size
        scene.place_camera(server, session.bounds)
        self._model = scene.ModelView(server, self._listen)
        self._nets = [
            scene.NetView(server, number, net, size) for number, net in enumerate(session.nets)
        ]
        self.holds = scene.Marks(server, "held", scene.PINNED, size)
        self.picked = scene.Marks(server, "picked", scene.SELECTED, size)
        self.folds = scene.Marks(server, "folds", scene.FOLDED, size)
        self.cells = scene.add_cells(server, session.cells)
        self.redraw()

    @property
    def frame(self) -> Frame:
        """The frame of the active lattice."""
        return self.session.lattice.members[self.session.active].layout.frame

    def written(self, point: Floats) -> Floats:
        """Coordinates (3,) of a model point as edits of the active lattice give them."""
        layout = self.session.lattice.members[self.session.active].layout
        return np.asarray(layout.frame.to_local(point) + layout.written_origin)

    # What the browser asks.

    def press(self, handle: viser.GuiButtonHandle, job: Job) -> None:
        """Do a job when a button is pressed."""

        async def pressed(_event: object) -> None:
            self.worker.do(job)

        handle.on_click(pressed)

    def choose(self, handle: viser.GuiButtonGroupHandle, jobs: dict[str, Job]) -> None:
        """Do the job of the button that is pressed in a row of them."""

        async def pressed(_event: object) -> None:
            self.worker.do(jobs[handle.value])

        handle.on_click(pressed)

    def change(self, handle: viser.GuiInputHandle[Any], job: Job, *, shown: bool = False) -> None:
        """Do a job when the user changes a field; if it only shows something, the newest alone."""

        async def changed(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None:
                (self.worker.show if shown else self.worker.do)(job)

        handle.on_update(changed)

    def drag_model(self, drag: Drag | None) -> None:
        """Call a function when the mouse drags the model; None lets it turn the view."""
        self._drag = drag
        for handle in self._model.handles.values():
            self._listen(handle)

    def _listen(self, handle: viser.MeshHandle) -> None:
        handle.remove_drag_callback()
        if self._drag is not None:
            handle.on_drag("left")(self._drag)

    # What is shown.

    def say(self, text: str) -> None:
        """Tell the user something in the panel."""
        self.saying(text)

    def complain(self, error: Exception) -> None:
        """Tell the user why something was not done; the drawn model is again as the session's."""
        if isinstance(error, Asked):
            return
        if isinstance(error, FfdError | OSError):
            self.say(f"**Not done.** {error}")
        else:
            traceback.print_exception(error, file=sys.stderr)
            self.say(f"**Internal error, please report it.** {type(error).__name__}: {error}")
        self.redraw()

    def show_preview(self, *edits: Edit) -> None:
        """Draw the model as edits would leave it; nothing is changed."""
        preview = self.session.preview(*self._allowed(edits))
        with self._drawing, self.server.atomic():
            self._previewing = True
            self._model.draw(self.session.drawn, preview.vertices)
            for view, points in zip(self._nets, preview.nets, strict=True):
                view.move(points)
        self.server.flush()

    def commit(self, *edits: Edit) -> None:
        """Append edits to the active lattice; one step to undo."""
        allowed = self._allowed(edits)
        if allowed:
            self.session.append(*allowed)
        self.redraw()

    def _allowed(self, edits: Sequence[Edit]) -> Sequence[Edit]:
        """The edits, or that part of them which is proved not to fold if the user wants so."""
        if not edits or not self.stops():
            return edits
        stop = self.session.last_proved(*edits)
        if stop.share < 1:
            self.say(f"Stopped at {100 * stop.share:.0f} %: {stop.message}")
        return list(stop.edits) if stop.share > 0 else []

    def redraw(self) -> None:
        """Draw the session as it is."""
        session = self.session
        for number, net in enumerate(session.nets):
            if len(self.selected[number]) != len(net.points):
                self.selected[number] = np.zeros(len(net.points), bool)
                self.pins[number] = np.zeros(len(net.points), bool)
        with self._drawing, self.server.atomic():
            self._previewing = False
            full = self.share == 1
            if self._judged_revision != session.revision:
                self._exact, self.verdict = None, ""
                self.folds.set(np.zeros((0, 3)))
            self._draw_model()
            nets = session.nets_at(self.share)
            for number, (view, net) in enumerate(zip(self._nets, session.nets, strict=True)):
                view.mark(net, self.selected[number], self.pins[number], self.see["hidden"])
                view.show(now=self.see["now"], rest=self.see["rest"])
                if not full:
                    view.move(nets[number])
        for follow in self.redrawn:
            follow()
        self.server.flush()

    def edit_lattice_at(self, point: Floats) -> None:
        """Let edits go to the lattice that holds a point (3,) of the undeformed model."""
        number = self.session.lattice_at(point)
        if number is not None and number != self.session.active:
            self.session.active = number
            self.redraw()

    def require_full(self) -> None:
        """Show the whole deformation: what is dragged must be where it is seen."""
        if self.share != 1:
            self.share = 1.0
            self.redraw()

    def _draw_model(self) -> None:
        """Draw the exact faces if they are known and wanted, or else the triangles kept."""
        session = self.session
        if self._exact is not None and self.see["exact"] and self.share == 1:
            self._model.draw(self._exact, self._exact.vertices)
        else:
            self._model.draw(session.drawn, session.vertices_at(self.share))

    def _rest(self, asked: Callable[[], bool]) -> None:
        """Find folds and draw the exact faces, while nothing is asked."""

        def go_on(_stage: str = "") -> None:
            if asked():
                raise Asked

        session = self.session
        revision = session.revision
        if revision == self._judged_revision or self._previewing:
            return
        folds = session.folds
        go_on()
        self.folds.set(folds.points)
        self.verdict = folds.message
        self.judged()
        exact = None
        try:
            if session.mesh.polygon_count <= MOST_EXACT:
                exact = session.exact(go_on)
        except FfdError as error:
            self.say(f"The exact faces cannot be made: {error}")
        with self._drawing, self.server.atomic():
            go_on()
            self._exact, self._judged_revision = exact, revision
            self._draw_model()
        self.server.flush()


def plain(text: str) -> str:
    """Text of a file for Markdown: shown as it is, on one line."""
    return "`" + printable(text).replace("`", "'") + "`"
