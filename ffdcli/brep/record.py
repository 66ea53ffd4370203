"""The boundary representation: topology in integers, geometry in batches of arrays.

Independent of OpenCascade. Closedness and orientation follow from the integers alone.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ffdcli.arrays import Bools, Floats, Ints, run_numbers


@dataclass(frozen=True)
class Curves:
    """Edges whose B-spline curves share a degree and a multiplicity pattern; domain [0, 1].

    Parameters
    ----------
    edges : (m,) int64
        The edges that lie on these curves, one curve each.
    degree : int
    knots : (m, nb) float64
        Distinct knots of each curve, the first 0 and the last 1.
    mults : (nb,) int64
        Their multiplicities; the end ones are ``degree + 1``.
    poles : (m, n, 3 or 4) float64, model length
        Control points; with 4 components homogeneous ``(wx, wy, wz, w)``. Degree 1 with two
        poles is a straight line.
    """

    edges: Ints
    degree: int
    knots: Floats
    mults: Ints
    poles: Floats


@dataclass(frozen=True)
class Surfaces:
    """Surfaces that share degrees and multiplicity patterns.

    Parameters
    ----------
    surfaces : (m,) int64
        Their numbers, as in ``Topology.face_surface``.
    degrees : (int, int)
    u_knots, v_knots : (m, nbu), (m, nbv) float64, lattice-frame parameters
        Distinct knots.
    u_mults, v_mults : (nbu,), (nbv,) int64
        Multiplicities; the end ones are ``degree + 1``.
    poles : (m, nu, nv, 3 or 4) float64, model length
    """

    surfaces: Ints
    degrees: tuple[int, int]
    u_knots: Floats
    v_knots: Floats
    u_mults: Ints
    v_mults: Ints
    poles: Floats


@dataclass(frozen=True)
class Planes:
    """Plane surfaces ``origin + s x_axis + t y_axis``.

    Parameters
    ----------
    surfaces : (m,) int64
        Their numbers, as in ``Topology.face_surface``.
    origin, x_axis, y_axis : (m, 3) float64
        The axes are unit and perpendicular; ``x_axis × y_axis`` is the outward normal of a face
        that is not reversed.
    """

    surfaces: Ints
    origin: Floats
    x_axis: Floats
    y_axis: Floats


@dataclass(frozen=True)
class Topology:
    """Vertices, edges, loops, faces, shells and solids in integers, with their geometry in batches.

    Parameters
    ----------
    points : (V, 3) float64, model length
        Vertices.
    edges : (E, 2) int64
        Start and end vertex of every edge; -1 where a file gives none.
    curves : batches that together cover every edge once, except edges without a curve.
    surfaces, planes : batches that together cover every surface number once.
    face_surface : (F,) int64
        Surface of each face; several faces may trim one surface.
    face_reversed : (F,) bool
        True where the face's outward normal is opposite to its surface's normal.
    face_loops : (F + 1,) int64
        Face ``f`` has loops ``face_loops[f]:face_loops[f + 1]``.
    loop_coedges : (L + 1,) int64
        Loop ``l`` has coedges ``loop_coedges[l]:loop_coedges[l + 1]``. Loops run counter-clockwise
        about the face's outward normal, holes clockwise.
    coedge_edge : (C,) int64
    coedge_forward : (C,) bool
        True where the loop runs the edge from its start to its end.
    face_shell : (F,) int64
        Shell of each face.
    shell_closed : (S,) bool
    shell_solid : (S,) int64
        Solid that the shell bounds; -1 for none.
    edge_tolerance, vertex_tolerance : (E,), (V,) float64, model length
    """

    points: Floats
    edges: Ints
    curves: tuple[Curves, ...]
    surfaces: tuple[Surfaces, ...]
    planes: Planes
    face_surface: Ints
    face_reversed: Bools
    face_loops: Ints
    loop_coedges: Ints
    coedge_edge: Ints
    coedge_forward: Bools
    face_shell: Ints
    shell_closed: Bools
    shell_solid: Ints
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

    @property
    def surface_count(self) -> int:
        """Number of surfaces."""
        return len(self.planes.surfaces) + sum(len(batch.surfaces) for batch in self.surfaces)

    @property
    def surface_degrees(self) -> tuple[str, ...]:
        """Degrees of each surface, the lower one first, such as ``3x6``; or ``plane``."""
        names = ["plane"] * self.surface_count
        for batch in self.surfaces:
            low, high = sorted(batch.degrees)
            for surface in batch.surfaces.tolist():
                names[surface] = f"{low}x{high}"
        return tuple(names)

    @property
    def surface_facts(self) -> dict[str, Any]:
        """Control points of the surfaces, their degrees, and whether any has weights."""
        return {
            "control_points": sum(batch.poles[..., 0].size for batch in self.surfaces),
            "degrees": dict(sorted(Counter(self.surface_degrees).items())),
            "rational": any(batch.poles.shape[-1] == 4 for batch in self.surfaces),
        }

    @cached_property
    def face_of_loop(self) -> Ints:
        """(L,) face of each loop."""
        return run_numbers(self.face_loops)

    @cached_property
    def loop_of_coedge(self) -> Ints:
        """(C,) loop of each coedge."""
        return run_numbers(self.loop_coedges)

    @cached_property
    def face_of_coedge(self) -> Ints:
        """(C,) face of each coedge."""
        return self.face_of_loop[self.loop_of_coedge]


@dataclass(frozen=True)
class Brep(Topology):
    """A closed or open boundary representation, as it is to be written.

    The first loop of a face is the outer one. Curves have the domain [0, 1]. The first shell of a
    solid is its outer one, the others are cavities.

    Parameters
    ----------
    pcurves : (C, 2, 2) float64
        Surface parameters at the *edge's* start and end; the pcurve is the straight segment
        between them with the edge's own parameter. Not used on planes.
    """

    pcurves: Floats


@dataclass(frozen=True)
class MassProperties:
    """Properties by which a receiver checks its import of a solid.

    Parameters
    ----------
    volume : float, cubed model length
    area : float, squared model length
        Of the boundary, cavities included.
    centroid : (x, y, z) float, model length
        Centre of the volume.
    volume_error, area_error, centroid_error : float
        Estimates of the largest errors of these, beyond rounding.
    """

    volume: float
    area: float
    centroid: tuple[float, float, float]
    volume_error: float = 0.0
    area_error: float = 0.0
    centroid_error: float = 0.0
