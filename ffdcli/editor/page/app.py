"""The page of a session: panels, keys and the life of its server."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Protocol

import numpy as np
import viser

from ffdcli.arrays import Floats
from ffdcli.editor.page.desk import Desk
from ffdcli.editor.page.history import HistoryPanel
from ffdcli.editor.page.keep import KeepPanel, Report
from ffdcli.editor.page.points import PointsPanel
from ffdcli.editor.page.pull import PullPanel
from ffdcli.editor.page.server import Visits, serve
from ffdcli.editor.page.settings import RulesPanel, SeePanel, StatusPanel
from ffdcli.editor.page.shapes import PeakPanel, WholePanel

if TYPE_CHECKING:
    from ffdcli.editor import Session

# Seconds after which a session without a page ends: if its page was closed (it may be loaded
# again), and if the connection was lost (the machine may have slept).
_CLOSED, _LOST = 10.0, 600.0
# Seconds between two looks at the file on disk.
_LOOK = 1.0


class Panel(Protocol):
    """A panel that takes the mouse while it is shown."""

    title: str

    def show(self, active: bool) -> None:
        """Take the mouse, or give it back."""

    def click(self, origin: Floats, direction: Floats, add: bool) -> None:
        """A click into the scene: the ray of the mouse, and whether Shift is held."""


class Presence:
    """Counts the tabs that are connected, and tells when the session has been without one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._count = 0
        self._ends: float | None = None

    def opened(self) -> None:
        """A tab has connected."""
        with self._lock:
            self._count += 1
            self._ends = None

    def ended(self, closed: bool) -> None:
        """A connection has ended, because its page was closed or not."""
        with self._lock:
            self._count -= 1
            if self._count == 0:
                self._ends = time.monotonic() + (_CLOSED if closed else _LOST)

    @property
    def over(self) -> bool:
        """Whether the session has been without a page for long enough."""
        with self._lock:
            return self._ends is not None and time.monotonic() > self._ends


def run(
    session: Session, port: int, opened: Callable[[str], None], told: Callable[[Report], str]
) -> None:
    """Serve the page of a session until it is closed, or an exception such as Ctrl-C comes.

    Parameters
    ----------
    session : Session
    port : int
        0 chooses a free one.
    opened : callable
        Takes the address once the page can be opened.
    told : callable
        The lines that tell of a report.

    Raises
    ------
    FfdError
        The port is in use.
    """
    presence = Presence()
    visits = Visits(presence.opened, presence.ended)
    with serve(port, f"{session.title} - ffd edit", visits) as (server, address):
        desk = Desk(session, server)
        try:
            keep = build(desk, told)
            desk.worker.start()
            opened(address)
            desk.worker.do(session.get_ready)
            while not presence.over:
                time.sleep(_LOOK)
                keep.look()
        finally:
            desk.worker.close()


def build(desk: Desk, told: Callable[[Report], str]) -> KeepPanel:
    """Add all panels and keys; returns the panel of files."""
    server, session = desk.server, desk.session
    gui = server.gui
    gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
    # Beside the model, not over it.
    gui.main_panel.dock_right()
    gui.set_panel_label(f"ffd edit: {session.title}")
    StatusPanel(desk)
    step = gui.add_button_group("Edits", ("Undo", "Redo"))
    jobs = {"Undo": lambda: _step(desk, session.undo), "Redo": lambda: _step(desk, session.redo)}
    desk.choose(step, jobs)
    tabs = gui.add_tab_group()
    with tabs.add_tab("Edit"):
        tool = gui.add_button_group("Tool", ("Pull", "Points", "Whole", "Peak"))
        panels: dict[str, Panel] = {
            "Pull": PullPanel(desk),
            "Points": PointsPanel(desk),
            "Whole": WholePanel(desk),
            "Peak": PeakPanel(desk),
        }
        RulesPanel(desk)
    with tabs.add_tab("History"):
        HistoryPanel(desk)
    with tabs.add_tab("View"):
        SeePanel(desk)
    with tabs.add_tab("Files"):
        keep = KeepPanel(desk, told)
    active = [panels["Pull"]]

    def take(panel: Panel) -> None:
        active[0] = panel
        for each in panels.values():
            if each is not panel:
                each.show(False)
        panel.show(True)
        desk.redraw()

    desk.choose(tool, {name: partial(take, panel) for name, panel in panels.items()})
    take(panels["Pull"])

    async def clicked(event: viser.SceneClickEvent) -> None:
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
        add = event.modifier == "shift"
        desk.worker.do(lambda: active[0].click(origin, direction, add))

    server.scene.on_click()(clicked)
    server.scene.on_click(modifier="shift")(clicked)
    for label, key, modifier, job in (
        ("Undo", "Z", "cmd/ctrl", jobs["Undo"]),
        ("Redo", "Z", "cmd/ctrl+shift", jobs["Redo"]),
        ("Redo (also)", "Y", "cmd/ctrl", jobs["Redo"]),
        ("Save", "S", "cmd/ctrl", keep.save),
    ):
        command = gui.add_command(label, hotkey=key, modifier=modifier)
        _on_key(desk, command, job)
    return keep


def _on_key(desk: Desk, command: viser.CommandHandle, job: Callable[[], None]) -> None:
    async def triggered(_event: object) -> None:
        desk.worker.do(job)

    command.on_trigger(triggered)


def _step(desk: Desk, step: Callable[[], bool]) -> None:
    if not step():
        desk.say("There is nothing more to undo or redo.")
    desk.redraw()
