"""Panels that twist, taper and bend a whole lattice, and that raise and sharpen peaks."""

from __future__ import annotations

import numpy as np
import viser

from ffdcli.arrays import Floats
from ffdcli.editor.page.desk import Desk, Edit
from ffdcli.editor.page.picking import POINT_HINT, number_text, numbers
from ffdcli.errors import FfdError

_AXES = ("u", "v", "w")
_KINDS = ("twist", "taper", "bend")


class WholePanel:
    """Twist, taper and bend with a slider."""

    title = "Twist, taper, bend"

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        gui = desk.server.gui
        with gui.add_folder(self.title) as self.folder:
            self._kind = gui.add_dropdown("Do", _KINDS)
            self._axis = gui.add_dropdown("Along", _AXES, initial_value="w")
            self._toward = gui.add_dropdown("Toward", _AXES, visible=False)
            self._angle = gui.add_slider("Degrees", -180.0, 180.0, 1.0, 0.0)
            self._factor = gui.add_slider("Factor", 0.1, 3.0, 0.01, 1.0, visible=False)
            self._exact = gui.add_text("Or exactly", "", hint="In place of the slider")
            done = gui.add_button_group("Then", ("Apply", "Back to zero"))
        for field in (self._axis, self._toward, self._angle, self._factor):
            desk.change(field, self._show, shown=True)
        desk.change(self._kind, self._change_kind)
        desk.choose(done, {"Apply": self._apply, "Back to zero": self._reset})

    def show(self, active: bool) -> None:
        """Take the mouse, or give it back."""
        self.folder.visible = active

    def click(self, _origin: Floats, _direction: Floats, _add: bool) -> None:
        """Nothing: the lattice changes as a whole."""

    def _change_kind(self) -> None:
        kind = self._kind.value
        self._toward.visible = kind == "bend"
        self._angle.visible, self._factor.visible = kind != "taper", kind == "taper"
        self._show()

    def _amount(self) -> float:
        if self._exact.value.strip():
            return numbers(self._exact.value, 1, "Or exactly")[0]
        return float(self._factor.value if self._kind.value == "taper" else self._angle.value)

    def _edits(self) -> list[Edit]:
        session, kind, amount = self._desk.session, self._kind.value, self._amount()
        if amount == (1 if kind == "taper" else 0):
            return []
        if kind == "twist":
            return session.twist(self._axis.value, amount)
        if kind == "taper":
            return session.taper(self._axis.value, amount)
        if self._toward.value == self._axis.value:
            raise FfdError("a bend needs two axes", hint="choose another axis under Toward")
        return session.bend(self._axis.value, self._toward.value, amount)

    def _show(self) -> None:
        self._desk.require_full()
        self._desk.show_preview(*self._edits())

    def _apply(self) -> None:
        edits = self._edits()
        if not edits:
            raise FfdError("the slider stands at its start, which changes nothing")
        self._desk.require_full()
        self._desk.commit(*edits)
        self._reset()

    def _reset(self) -> None:
        self._angle.value, self._factor.value, self._exact.value = 0.0, 1.0, ""
        self._desk.redraw()


class PeakPanel:
    """Hammer and crimp (Song & Yang 2005)."""

    title = "Raise or sharpen a peak"

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        gui, session = desk.server.gui, desk.session
        with gui.add_folder(self.title) as self.folder:
            gui.add_markdown("Click on the model where the peak is, or shall be.")
            self._point = gui.add_text("Point", "", hint=POINT_HINT)
            self._height = gui.add_text("Height", number_text(_start(session.size)))
            self._weights = gui.add_checkbox("By weights alone", False)
            hammer = gui.add_button("Hammer to this height", icon=viser.Icon.HAMMER)
            self._sharpness = gui.add_text("Sharpness", "2")
            self._crimp_button = gui.add_button("Crimp")
            self._told = gui.add_markdown(
                "Crimp needs weights: `volume: nurbs` in the lattice file."
            )
        desk.press(hammer, self._hammer)
        desk.press(self._crimp_button, self._crimp)
        desk.redrawn.append(self._redrawn)

    def show(self, active: bool) -> None:
        """Take the mouse, or give it back."""
        self.folder.visible = active
        self._desk.picked.show(active)

    def click(self, origin: Floats, direction: Floats, _add: bool) -> None:
        """Pick the point of the model under the mouse."""
        self._desk.require_full()
        hit = self._desk.session.hit(origin, direction)
        if hit is not None:
            self._desk.edit_lattice_at(hit.rest)
            self._point.value = number_text(self._desk.session.neat(hit.rest))
            self._desk.picked.set(np.asarray(hit.point)[None])

    def _redrawn(self) -> None:
        weighted = self._desk.session.weighted()
        self._weights.visible = self._sharpness.visible = self._crimp_button.visible = weighted
        self._told.visible = not weighted

    def _at(self) -> list[float]:
        return numbers(self._point.value, 3, "Point")

    def _hammer(self) -> None:
        height = numbers(self._height.value, 1, "Height")[0]
        session = self._desk.session
        by = "weights" if self._weights.value and session.weighted() else "displacement"
        self._desk.commit(*session.hammer(self._at(), height, by=by, plane=self._desk.plane()))

    def _crimp(self) -> None:
        sharpness = numbers(self._sharpness.value, 1, "Sharpness")[0]
        session = self._desk.session
        self._desk.commit(*session.crimp(self._at(), sharpness, plane=self._desk.plane()))


def _start(size: float) -> float:
    """A height to begin with: about a tenth of the model, one digit."""
    return float(f"{size / 10:.0e}")
