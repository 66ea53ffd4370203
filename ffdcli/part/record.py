"""A part as it was read: topology in integers, geometry as records, in model coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, run_numbers
from ffdcli.part.curves import Curve
from ffdcli.part.surfaces import Plane, Surface


@dataclass(frozen=True, eq=False)
class Part:
    """A boundary representation whose faces lie on surfaces of any kind.

    Instances of an assembly are faces, edges and vertices of their own, each where it stands.

    Parameters
    ----------
    points : (V, 3) float64, model length
        Vertices.
    vertex_tolerance : (V,) float64, model length
    edges : (E, 2) int64
        Vertices at the start and end of every edge's curve; -1 where a closed edge has none.
    curves : (E,) tuple of Curve or None
        None for degenerate edges, which are a point.
    edge_range : (E, 2) float64
        Parameters at the start and end of every edge.
    edge_tolerance : (E,) float64, model length
    degenerate : (E,) bool
    same_parameter : (E,) bool
        Whether the pcurves of the edge give the points of its curve at the same parameters.
    surfaces : (F,) tuple of Surface
        The surface of each face, its own even where the file shares one.
    rectangles : (F, 2, 2) float64
        Parameters that each face reaches, its outline included: ``[[u_low, v_low],
        [u_high, v_high]]``. On periodic surfaces it may lie some periods away from the domain.
    face_tolerance : (F,) float64, model length
    face_reversed : (F,) bool
        True where the face's outward normal is opposite to ``du cross dv``.
    face_loops : (F + 1,) int64
        Face ``f`` has loops ``face_loops[f]:face_loops[f + 1]``.
    loop_coedges : (L + 1,) int64
        Loop ``l`` has coedges ``loop_coedges[l]:loop_coedges[l + 1]``.
    coedge_edge : (C,) int64
    coedge_forward : (C,) bool
        True where the loop runs the edge from its start to its end.
    pcurves : (C,) tuple of Curve or None
        Curves in the parameters of the face, over the range of the edge; None for none.
    seam : (C,) bool
        True where the face has the edge twice, once on either side of its parameters.
    face_shell : (F,) int64
        Shell of each face.
    shell_closed : (S,) bool
    shell_solid : (S,) int64
        Solid that the shell bounds; -1 for none.
    face_names, solid_names : tuples of str or None
    unit : str or None
        Length unit that the file states.
    bounds : (2, 3) float64, model length
        Lowest and highest coordinates of the shape: of its faces and edges, not of their poles.
    valid : bool
        Whether the kernel finds the part valid.
    source : str
        File name, for messages.
    handle : object
        What the kernel keeps of the file. Only ``ffdcli.brep.occ.part`` knows what it is.
    notes : tuple of str
        What was repaired when the part was read.
    """

    points: Floats
    vertex_tolerance: Floats
    edges: Ints
    curves: tuple[Curve | None, ...]
    edge_range: Floats
    edge_tolerance: Floats
    degenerate: Bools
    same_parameter: Bools
    surfaces: tuple[Surface, ...]
    rectangles: Floats
    face_tolerance: Floats
    face_reversed: Bools
    face_loops: Ints
    loop_coedges: Ints
    coedge_edge: Ints
    coedge_forward: Bools
    pcurves: tuple[Curve | None, ...]
    seam: Bools
    face_shell: Ints
    shell_closed: Bools
    shell_solid: Ints
    face_names: tuple[str | None, ...]
    solid_names: tuple[str | None, ...]
    unit: str | None
    bounds: Floats
    valid: bool = True
    source: str = "part"
    handle: Any = None
    notes: tuple[str, ...] = ()

    @property
    def face_count(self) -> int:
        """Number of faces."""
        return len(self.surfaces)

    @property
    def solid_count(self) -> int:
        """Number of solids."""
        return int(self.shell_solid.max(initial=-1)) + 1

    @property
    def size(self) -> float:
        """Diagonal of the bounding box, model length; tolerances are shares of it."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @property
    def delta(self) -> float:
        """Distance within which points count as one place, model length."""
        return 1e-9 * self.size

    @cached_property
    def face_of_loop(self) -> Ints:
        """(L,) face of each loop."""
        return run_numbers(self.face_loops)

    @cached_property
    def face_of_coedge(self) -> Ints:
        """(C,) face of each coedge."""
        return self.face_of_loop[run_numbers(self.loop_coedges)]

    def named_face(self, face: int) -> str:
        """``face 3``, with the name where the file gives one."""
        name = self.face_names[face]
        return f"face {face + 1}" + (f" ({name!r})" if name else "")

    @property
    def polyhedral(self) -> bool:
        """Whether all faces are planes and all edges lines."""
        return all(each.kind == "plane" for each in self.surfaces) and all(
            each is None or each.kind == "line" for each in self.curves
        )


class NewGeometry(Protocol):
    """Geometry for the topology of a part; None where it stays as it was read.

    New surfaces have the parameters of the old ones, so that pcurves hold; those of planes may
    have others, see ``planes``.
    """

    @property
    def surfaces(self) -> tuple[Surface | None, ...]:
        """(F,) surfaces of the faces."""
        ...

    @property
    def planes(self) -> tuple[Plane | None, ...]:
        """(F,) planes as read, with the parameters of the new surface; None where it has the old.

        Curves on these faces follow from the curves of their edges.
        """
        ...

    @property
    def curves(self) -> tuple[Curve | None, ...]:
        """(E,) curves of the edges."""
        ...

    @property
    def edge_range(self) -> Floats:
        """(E, 2) parameters of the edges; as read, except on lines between planes."""
        ...

    @property
    def points(self) -> Floats:
        """(V, 3) vertices, model length."""
        ...

    @property
    def mirrored(self) -> Bools:
        """(S,) shells whose faces are to be turned."""
        ...

    @property
    def edge_tolerance(self) -> Floats:
        """(E,) model length."""
        ...

    @property
    def vertex_tolerance(self) -> Floats:
        """(V,) model length."""
        ...
