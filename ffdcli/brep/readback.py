"""What a CAD file holds, in plain arrays: the record a verifier works on.

Nothing here knows OpenCascade. Names and senses are those of :class:`ffdcli.brep.record.Brep`;
what a written file may do otherwise (any curve range, any pcurve, broken loops) is kept as found.
"""

from __future__ import annotations

from dataclasses import dataclass

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.record import Curves, Planes, Surfaces


@dataclass(frozen=True)
class Pcurves:
    """Curves in surface parameters that share a degree and a multiplicity pattern.

    Parameters
    ----------
    coedges : (m,) int64
        The coedges that use them, one curve each.
    degree : int
    knots : (m, nb) float64
        Distinct knots of each curve.
    mults : (nb,) int64
    poles : (m, n, 2 or 3) float64, surface parameters
        With 3 components homogeneous ``(wu, wv, w)``.
    """

    coedges: Ints
    degree: int
    knots: Floats
    mults: Ints
    poles: Floats


@dataclass(frozen=True)
class ReadBrep:
    """The faces, edges and vertices of a CAD file, nothing repaired.

    Parameters
    ----------
    points : (V, 3) float64, model length
        Vertices; one number for each vertex object of the file, however close two may lie.
    edges : (E, 2) int64
        Start and end vertex; -1 where the file gives none.
    edge_range : (E, 2) float64
        Parameters of the 3D curve at the edge's start and end. Pcurves have the same parameter.
    curves : batches that together cover every edge once, except those without a curve.
        A straight line is degree 1 with knots ``edge_range`` and the two end points as poles.
    surfaces, planes : batches that together cover every surface number once.
        On a plane, parameters are lengths along ``x_axis`` and ``y_axis``.
    face_surface : (F,) int64
        Surface of each face; several faces may trim one surface.
    face_reversed : (F,) bool
        True where the outward normal, as solid, shell and face say together, is opposite to the
        surface's normal.
    face_loops : (F + 1,) int64
        Face ``f`` has loops ``face_loops[f]:face_loops[f + 1]``, in the file's order.
    loop_coedges : (L + 1,) int64
        Loop ``l`` has coedges ``loop_coedges[l]:loop_coedges[l + 1]``, in the order in which a
        loop runs counter-clockwise about the outward normal. Chained only if the file's are.
    coedge_edge : (C,) int64
    coedge_forward : (C,) bool
        True where the loop, seen against the outward normal, runs the edge start to end.
    pcurves : batches that together cover every coedge once.
        On planes computed from the 3D curve, if the file has none; on other surfaces a coedge
        may be missing where the file has none.
    face_shell : (F,) int64
    shell_closed : (S,) bool
        What the kernel says of each shell.
    shell_solid : (S,) int64
        Solid of each shell, in the file's order; -1 for a shell or face that bounds none.
    face_tolerance, edge_tolerance, vertex_tolerance : (F,), (E,), (V,) float64, model length
    """

    points: Floats
    edges: Ints
    edge_range: Floats
    curves: tuple[Curves, ...]
    surfaces: tuple[Surfaces, ...]
    planes: Planes
    face_surface: Ints
    face_reversed: Bools
    face_loops: Ints
    loop_coedges: Ints
    coedge_edge: Ints
    coedge_forward: Bools
    pcurves: tuple[Pcurves, ...]
    face_shell: Ints
    shell_closed: Bools
    shell_solid: Ints
    face_tolerance: Floats
    edge_tolerance: Floats
    vertex_tolerance: Floats

    @property
    def face_count(self) -> int:
        """Number of faces."""
        return len(self.face_surface)

    @property
    def solid_count(self) -> int:
        """Number of solids."""
        return int(self.shell_solid.max(initial=-1)) + 1
