"""Panels of what is seen, and of what holds for all edits."""

from __future__ import annotations

import viser

from ffdcli.editor import Plane
from ffdcli.editor.page.desk import Desk, plain
from ffdcli.editor.page.worker import Job

_NO_PLANE = "nothing"


class SeePanel:
    """What is drawn, and how much of the deformation."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        gui, session = desk.server.gui, desk.session
        self._share = gui.add_slider(
            "Before - after", 0.0, 1.0, 0.01, 1.0, hint="Share of the deformation that is drawn"
        )
        desk.change(self._share, self._show_share, shown=True)
        names = {
            "now": "Lattice",
            "rest": "Lattice at rest",
            "hidden": "Control points of empty cells",
            "exact": "Exact faces, when the model rests",
        }
        for key, label in names.items():
            box = gui.add_checkbox(
                label,
                desk.see[key],
                visible=key != "hidden" or any(net.hidden.any() for net in session.nets),
            )
            desk.change(box, self._setter(key, box))
        cells = desk.cells
        if cells is not None:
            seen = gui.add_checkbox("Octree cells", False)
            desk.change(seen, lambda: setattr(cells, "visible", seen.value))
        folds = gui.add_checkbox("Places that fold", True)
        desk.change(folds, lambda: desk.folds.show(folds.value))
        gui.add_markdown(
            "Control points: orange, free; grey, locked by the border; purple, of empty cells; "
            "dark blue, pinned; magenta, selected. Red marks places that fold."
        )
        desk.redrawn.append(self._redrawn)

    def _setter(self, key: str, box: viser.GuiInputHandle[bool]) -> Job:
        def change() -> None:
            self._desk.see[key] = box.value
            self._desk.redraw()

        return change

    def _show_share(self) -> None:
        self._desk.share = float(self._share.value)
        self._desk.redraw()

    def _redrawn(self) -> None:
        self._share.value = self._desk.share


class RulesPanel:
    """Settings for all edits: mirror plane, stop at folds, active lattice."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        gui, session = desk.server.gui, desk.session
        stop = gui.add_checkbox(
            "Stop at the last proved position",
            False,
            hint="An edit goes no further than to where the lattice is proved not to fold",
        )
        axis = gui.add_dropdown(
            "Symmetric about",
            (_NO_PLANE, "x", "y", "z"),
            hint="Each edit is made at its mirror image too; the plane is the middle of the model",
        )
        desk.stops = lambda: bool(stop.value)
        desk.plane = lambda: (
            None if axis.value == _NO_PLANE else Plane.of_axis(axis.value, session.bounds)
        )
        if session.count > 1:
            names = tuple(str(number + 1) for number in range(session.count))
            active = gui.add_dropdown("Lattice that is edited", names)

            def change() -> None:
                session.active = names.index(active.value)
                desk.redraw()

            desk.change(active, change)
            desk.redrawn.append(lambda: setattr(active, "value", names[session.active]))


class StatusPanel:
    """One line of state and one of what was done last."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        gui = desk.server.gui
        self._state = gui.add_markdown("")
        self._told = gui.add_markdown(" ".join(desk.session.notices))
        self._mark = gui.add_html("")
        desk.saying = self._say
        desk.judged = self._redrawn
        desk.redrawn.append(self._redrawn)

    def _say(self, text: str) -> None:
        self._told.content = text

    def _redrawn(self) -> None:
        session = self._desk.session
        count = sum(len(session.edits(number)) for number in range(session.count))
        kept = "**not saved**" if session.unsaved else "saved"
        parts = [
            plain(session.path.name),
            f"{count} edit" if count == 1 else f"{count} edits",
            kept,
        ]
        parts += [self._desk.verdict] if self._desk.verdict else []
        self._state.content = " · ".join(parts)
        # The page looks for this mark when it is left.
        asks = session.unsaved and (count > 0 or session.path.exists())
        self._mark.content = "<span data-ffd-unsaved></span>" if asks else ""
