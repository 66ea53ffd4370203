"""The drawn scene of the page: model, lattices, cells, folds and marks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import viser
from numpy.typing import NDArray

from ffdcli.arrays import Bools, Bytes, Floats, Ints
from ffdcli.view import colours

if TYPE_CHECKING:
    from ffdcli.editor.drawn import Drawn
    from ffdcli.editor.nets import Net

Singles = NDArray[np.float32]

# Diameters of points over the size of the model, and the thickness of lines in pixels.
_POINT, _MARK = 0.008, 0.014
_LINE = 1.5
# Angle of view of a new tab from top to bottom, radians.
VIEW_ANGLE = np.pi / 4
SELECTED = "#d6009a"
PINNED = colours.DRAG
FOLDED = "#e00000"


def rgb8(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, from 0 to 255, of a colour ``#rrggbb``."""
    red, green, blue = (round(255 * part) for part in colours.rgb(colour))
    return red, green, blue


@dataclass(frozen=True)
class _Group:
    """Faces of one colour, which share no vertices with others.

    Parameters
    ----------
    colour : triple of int
    vertices : (n,) int64
        Their numbers in the model.
    triangles : (T, 3) uint32
        Corners by place in these.
    """

    colour: tuple[int, int, int]
    vertices: Ints
    triangles: NDArray[np.uint32]


def _groups(drawn: Drawn) -> list[_Group]:
    found, number = np.unique(drawn.colours, axis=0, return_inverse=True)
    number = number.ravel()
    place = np.empty(len(number), dtype=np.int64)
    groups = []
    for group, (red, green, blue) in enumerate(found.tolist()):
        own = np.flatnonzero(number == group)
        place[own] = np.arange(len(own))
        triangles = drawn.triangles[number[drawn.triangles[:, 0]] == group]
        groups.append(_Group((red, green, blue), own, place[triangles].astype(np.uint32)))
    return groups


class ModelView:
    """The model as meshes of one colour each.

    Other triangles replace what these meshes hold: viser ends a drag of a mesh that is hidden or
    taken away.

    Parameters
    ----------
    server : ViserServer
    added : callable
        Called with each mesh that is added to the scene.
    """

    def __init__(
        self, server: viser.ViserServer, added: Callable[[viser.MeshHandle], None]
    ) -> None:
        self._scene, self._added = server.scene, added
        self._drawn: Drawn | None = None
        self._groups: list[_Group] = []
        self.handles: dict[tuple[int, int, int], viser.MeshHandle] = {}
        self._outline = self._scene.add_line_segments(
            "/model/edges",
            np.zeros((1, 2, 3), dtype=np.float32),
            rgb8(colours.LINE),
            thickness=_LINE,
            thickness_units="screen",
            visible=False,
        )

    def draw(self, drawn: Drawn, vertices: Floats) -> None:
        """Draw a model with its vertices in certain places.

        Parameters
        ----------
        drawn : Drawn
        vertices : (V, 3) float64, model length
        """
        single = vertices.astype(np.float32)
        if drawn is not self._drawn:
            self._replace(drawn, single)
        for group in self._groups:
            whole = len(self._groups) == 1
            self.handles[group.colour].vertices = single if whole else single[group.vertices]
        if len(drawn.outline):
            self._outline.points = single[drawn.outline]

    def _replace(self, drawn: Drawn, single: Singles) -> None:
        self._drawn, self._groups = drawn, _groups(drawn)
        for group in self._groups:
            handle = self.handles.get(group.colour)
            if handle is not None:
                handle.vertices = single[group.vertices]
                handle.faces = group.triangles
                continue
            handle = self._scene.add_mesh_simple(
                "/model/{}-{}-{}".format(*group.colour),
                single[group.vertices],
                group.triangles,
                color=group.colour,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )
            self.handles[group.colour] = handle
            self._added(handle)
        used = {group.colour for group in self._groups}
        for colour, handle in self.handles.items():
            if colour not in used:
                handle.faces = np.zeros((0, 3), dtype=np.uint32)
        self._outline.visible = len(drawn.outline) > 0


class NetView:
    """A lattice: control points, the lines between them, and where they rest."""

    def __init__(self, server: viser.ViserServer, number: int, net: Net, size: float) -> None:
        scene, name = server.scene, f"/lattice-{number}"
        self._net = net
        self._selected: Bools = np.zeros(len(net.points), dtype=bool)
        self._pinned: Bools = self._selected
        self._hidden_points = False
        self._scene, self._name, self._size = scene, name, size
        self._points = self._add(net.points)
        self._lines = scene.add_line_segments(
            f"{name}/lines",
            net.points[net.lines].astype(np.float32),
            rgb8(colours.LATTICE),
            thickness=_LINE,
            thickness_units="screen",
        )
        self._rest = scene.add_line_segments(
            f"{name}/rest",
            net.rest[net.lines].astype(np.float32),
            rgb8(colours.BEFORE),
            thickness=_LINE,
            thickness_units="screen",
            visible=False,
        )

    def _add(self, points: Floats) -> viser.PointCloudHandle:
        return self._scene.add_point_cloud(
            f"{self._name}/points",
            self._shown(points),
            self._colours(),
            point_size=_POINT * self._size,
            point_shape="circle",
            precision="float32",
        )

    def move(self, points: Floats) -> None:
        """Draw the control points (n, 3) elsewhere."""
        self._points.points = self._shown(points)
        self._lines.points = points[self._net.lines].astype(np.float32)

    def mark(self, net: Net, selected: Bools, pinned: Bools, hidden_points: bool) -> None:
        """Draw the control points of the lattice as it is now, with other marks.

        Parameters
        ----------
        net : Net
        selected, pinned : (n,) bool
        hidden_points : bool
            Whether control points of empty cells are drawn.
        """
        self._net, self._selected, self._pinned = net, selected, pinned
        self._hidden_points = hidden_points
        if len(self._points.points) == self._drawn().sum():
            self._points.colors = self._colours()
            self.move(net.points)
        else:
            self._points.remove()
            self._points = self._add(net.points)

    def show(self, *, now: bool, rest: bool) -> None:
        """Show the lattice as it is now, and at rest, or hide them."""
        self._points.visible = self._lines.visible = now
        self._rest.visible = rest

    def _drawn(self) -> Bools:
        return ~self._net.hidden | self._hidden_points | self._selected

    def _shown(self, points: Floats) -> Singles:
        return np.asarray(points[self._drawn()], dtype=np.float32)

    def _colours(self) -> Bytes:
        found = np.tile(np.array(rgb8(colours.POINT), dtype=np.uint8), (len(self._selected), 1))
        for mask, colour in (
            (self._net.hidden, colours.HIDDEN),
            (self._net.locked, colours.LOCKED),
            (self._pinned, PINNED),
            (self._selected, SELECTED),
        ):
            found[mask] = rgb8(colour)
        return found[self._drawn()]


class Marks:
    """Points of one kind, in one colour."""

    def __init__(
        self, server: viser.ViserServer, name: str, colour: str, size: float, scale: float = _MARK
    ) -> None:
        self._server = server
        self._name, self._colour, self._size = f"/{name}", rgb8(colour), scale * size
        self._cloud: viser.PointCloudHandle | None = None
        self._visible = True

    def set(self, points: Floats | Sequence[Floats]) -> None:
        """Mark points (n, 3), model length, instead of those before."""
        found = np.asarray(points, dtype=np.float32).reshape(-1, 3)
        if self._cloud is not None and len(self._cloud.points) == len(found):
            self._cloud.points = found
            return
        if self._cloud is not None:
            self._cloud.remove()
            self._cloud = None
        if len(found):
            self._cloud = self._server.scene.add_point_cloud(
                self._name,
                found,
                self._colour,
                point_size=self._size,
                point_shape="circle",
                precision="float32",
                visible=self._visible,
            )

    def show(self, visible: bool) -> None:
        """Show the points or hide them."""
        self._visible = visible
        if self._cloud is not None:
            self._cloud.visible = visible


def add_cells(server: viser.ViserServer, cells: Floats) -> viser.LineSegmentsHandle | None:
    """The edges (m, 2, 3) of octree cells; None if there are none."""
    if not len(cells):
        return None
    return server.scene.add_line_segments(
        "/cells",
        cells.astype(np.float32),
        rgb8(colours.CELL),
        thickness=_LINE,
        thickness_units="screen",
        visible=False,
    )


def first_view(bounds: Floats) -> tuple[Floats, Floats]:
    """Place of the camera and the point that it looks at, of a new tab.

    It looks at the longer side of the model, from above and a little from its end.

    Parameters
    ----------
    bounds : (2, 3) float64, model length
    """
    centre, extent = bounds.mean(axis=0), bounds[1] - bounds[0]
    across = (0.55, -1.05) if extent[0] >= extent[1] else (1.05, -0.55)
    return centre + float(np.linalg.norm(extent)) * np.array([*across, 0.65]), centre


def place_camera(server: viser.ViserServer, bounds: Floats) -> None:
    """Let new tabs look at a model with these bounds (2, 3), model length."""
    camera, size = server.initial_camera, float(np.linalg.norm(bounds[1] - bounds[0]))
    camera.position, camera.look_at = first_view(bounds)
    camera.fov = VIEW_ANGLE
    camera.near, camera.far = size / 1000, size * 100
