"""A session: one model, one lattice file, and the edits that are made by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ffdcli.arrays import Bools
from ffdcli.editor import making, runs
from ffdcli.editor.mirror import Plane
from ffdcli.editor.selecting import selectors_of
from ffdcli.editor.showing import ShownSession
from ffdcli.errors import FileError
from ffdcli.stopwatch import Progress

Edit = dict[str, Any]


class Session(ShownSession):
    """A model and its lattices as they are edited by hand.

    All points are in model coordinates. Methods may be called from any thread. What makes edits
    returns them; :meth:`preview` shows them, and :meth:`append` makes them.
    """

    def selectors(self, mask: Bools, n: int | None = None) -> list[Any]:
        """Values of `at` that together select exactly the control points of a mask."""
        return selectors_of(self.member(n), np.asarray(mask))

    def neat(self, values: Any) -> Any:
        """Numbers rounded to a millionth of the size, as a person would write them."""
        return making.neat(values, self.size)

    def drag(
        self,
        points: Any,
        by: Any,
        *,
        pin: Sequence[Any] = (),
        hold: Sequence[Any] = (),
        plane: Plane | None = None,
        vary: str = "points",
    ) -> list[Edit]:
        """A drag of points (m, 3) of the undeformed model by displacements (m, 3).

        Points that rounding has carried out of a lattice box are put onto its side.
        """
        return making.drag_edits(
            np.asarray(points, dtype=np.float64).reshape(-1, 3),
            np.asarray(by, dtype=np.float64).reshape(-1, 3),
            self.lattice.members,
            size=self.size,
            pin=pin,
            hold=hold,
            plane=plane,
            vary=vary,
        )

    def move(
        self, mask: Bools, by: Any, *, plane: Plane | None = None, n: int | None = None
    ) -> list[Edit]:
        """Moves of control points (m,), by a displacement in the coordinates of the edits."""
        return making.move_edits(self.member(n), np.asarray(mask), by, self.size, plane)

    def transform(
        self,
        mask: Bools,
        *,
        scale: Any = None,
        rotate: tuple[str, float] | None = None,
        translate: Any = None,
        center: Any = None,
        plane: Plane | None = None,
        n: int | None = None,
    ) -> list[Edit]:
        """Transformations of control points (m,), in the coordinates of the edits."""
        turn = rotate and {"axis": rotate[0], "angle": rotate[1]}
        given = {"scale": scale, "rotate": turn, "translate": translate, "center": center}
        value = {key: each for key, each in given.items() if each is not None}
        value = {k: each if isinstance(each, dict) else list(each) for k, each in value.items()}
        return making.transform_edits(self.member(n), np.asarray(mask), value, plane)

    def weight(
        self, mask: Bools, value: float, *, plane: Plane | None = None, n: int | None = None
    ) -> list[Edit]:
        """The weight of control points (m,)."""
        return making.weight_edits(self.member(n), np.asarray(mask), value, plane)

    def hammer(
        self,
        point: Any,
        height: float,
        *,
        by: str = "displacement",
        plane: Plane | None = None,
    ) -> list[Edit]:
        """The height of a peak at a point of the undeformed model."""
        value = {"height": height} | ({} if by == "displacement" else {"by": by})
        return making.peak_edits("hammer", np.asarray(point), value, plane, self.size)

    def crimp(self, point: Any, sharpness: float, *, plane: Plane | None = None) -> list[Edit]:
        """The sharpness of a peak at a point of the undeformed model."""
        value = {"sharpness": sharpness}
        return making.peak_edits("crimp", np.asarray(point), value, plane, self.size)

    @staticmethod
    def twist(axis: str, degrees: float) -> list[Edit]:
        """A twist of the whole lattice."""
        return [{"twist": {"axis": axis, "angle": degrees}}]

    @staticmethod
    def taper(axis: str, factor: float) -> list[Edit]:
        """A taper of the whole lattice."""
        return [{"taper": {"axis": axis, "factor": factor}}]

    @staticmethod
    def bend(axis: str, toward: str, degrees: float) -> list[Edit]:
        """A bend of the whole lattice."""
        return [{"bend": {"axis": axis, "toward": toward, "angle": degrees}}]

    def write_cad(
        self, progress: Progress | None = None, options: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """Save, then deform the model by the saved file into the output; the report.

        Raises
        ------
        FfdError
        """
        self.require_same_model()
        self.save()
        self._report = runs.run(
            "deform",
            self.output,
            self.model_path,
            self.path,
            options=options or {},
            progress=progress,
        )
        return self._report

    def verify(self, progress: Progress | None = None) -> dict[str, Any]:
        """Compare the output with the model deformed by the saved file; the report.

        Raises
        ------
        FfdError
        """
        self.require_same_model()
        if not self.output.exists() or not self.path.exists():
            message = "there is nothing to verify yet"
            raise FileError(message, file=str(self.output), hint="write it first")
        stated = getattr(self, "_report", None)
        return runs.run(
            "verify",
            self.output,
            self.model_path,
            self.path,
            options={} if stated is None else {"stated": stated},
            progress=progress,
        )
