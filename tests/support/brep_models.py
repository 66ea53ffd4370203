"""Small boundary representations made by hand, for the tests of everything that takes one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import comb

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.brep.labels import BodyLabels, ShapeLabels
from ffdcli.brep.record import Brep, Curves, MassProperties, Planes, Surfaces
from ffdcli.labels import Material
from support.jobs import CUBE as UNIT_CUBE

Mapping = Callable[[Floats], Floats]
Loops = list[list[int]]

# Counter-clockwise seen from outside.
CUBE_FACES: list[Loops] = [
    [[0, 1, 3, 2]],
    [[4, 6, 7, 5]],
    [[0, 4, 5, 1]],
    [[2, 3, 7, 6]],
    [[0, 2, 6, 4]],
    [[1, 5, 7, 3]],
]


def bumpy(points: Floats) -> Floats:
    """Bend space by a map cubic in each coordinate: no plane stays plane, no line straight."""
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack(
        [
            x + 0.2 * y**3 - 0.1 * z**2 + 0.05 * x * y * z,
            y + 0.15 * z**3 - 0.1 * x**2 * z,
            z + 0.25 * x**2 * y - 0.1 * x**3 + 0.1 * y**2,
        ],
        axis=-1,
    )


def projective(points: Floats) -> Floats:
    """Bend space by a rational map, in homogeneous components cubic in each coordinate."""
    x, y, z = np.moveaxis(points, -1, 0)
    w = 1 + 0.25 * x + 0.125 * y * z
    image = np.stack([x + 0.2 * y**2, y + 0.15 * z**2, z + 0.2 * x * y], axis=-1)
    return np.concatenate([image * w[..., None], w[..., None]], axis=-1)


def _bernstein(degree: int, t: Floats) -> Floats:
    return np.stack(
        [comb(degree, i) * t**i * (1 - t) ** (degree - i) for i in range(degree + 1)], axis=-1
    )


def _bezier_inverse(degree: int) -> tuple[Floats, Floats]:
    sites = np.linspace(0, 1, degree + 1)
    return sites, np.linalg.inv(_bernstein(degree, sites))


def axis_brep(
    points: Floats,
    faces: Sequence[Loops],
    mapping: Mapping | None = None,
    *,
    degree: int = 3,
    face_shell: Sequence[int] | None = None,
    shell_solid: Sequence[int] = (0,),
    shell_closed: Sequence[bool] | None = None,
    tolerance: float = 1e-7,
) -> Brep:
    """Make the record of a solid with axis-parallel planar faces, mapped where a map is given.

    ``degree`` must reach the map's degree in each coordinate. A map may give 4 homogeneous
    components ``(wx, wy, wz, w)``: then curves and surfaces are rational.
    """
    points = np.asarray(points, dtype=float)
    numbers: dict[tuple[int, int], int] = {}
    coedges, forward, pcurves = [], [], []
    loop_sizes, face_sizes, frames, reverse, boxes = [], [], [], [], []
    for loops in faces:
        corners = points[loops[0]]
        area = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
        a = int(np.argmax(np.abs(area)))
        b, c = (a + 1) % 3, (a + 2) % 3
        frames.append((a, b, c, corners[0, a]))
        reverse.append(bool(area[a] < 0))
        low, high = corners.min(axis=0), corners.max(axis=0)
        boxes.append((low[[b, c]], high[[b, c]]))
        face_sizes.append(len(loops))
        for loop in loops:
            loop_sizes.append(len(loop))
            for p, q in zip(loop, loop[1:] + loop[:1], strict=True):
                key = (min(p, q), max(p, q))
                coedges.append(numbers.setdefault(key, len(numbers)))
                forward.append((p, q) == key)
                pcurves.append([points[key[0], [b, c]], points[key[1], [b, c]]])
    edges = np.array(list(numbers))
    count, face_count = len(edges), len(faces)
    a, b, c = np.array([frame[:3] for frame in frames]).T
    image = points if mapping is None else mapping(points)
    if image.shape[1] == 4:
        image = image[:, :3] / image[:, 3:]

    none = Planes(np.zeros(0, int), *(np.zeros((0, 3)) for _ in range(3)))
    if mapping is None:
        identity = np.eye(3)
        origin = np.zeros((face_count, 3))
        origin[np.arange(face_count), a] = [frame[3] for frame in frames]
        planes = Planes(np.arange(face_count), origin, identity[b], identity[c])
        surfaces: tuple[Surfaces, ...] = ()
        n = 1
        curve_poles = points[edges]
    else:
        n = degree
        sites, inverse = _bezier_inverse(n)
        t = sites[None, :, None]
        curve_poles = np.einsum(
            "ij,ejk->eik",
            inverse,
            mapping(points[edges[:, :1]] * (1 - t) + points[edges[:, 1:]] * t),
        )
        low, high = np.array(boxes).transpose(1, 0, 2)
        grid = np.zeros((face_count, n + 1, n + 1, 3))
        for f, (axis, first, second, height) in enumerate(frames):
            span = low[f] + sites[:, None] * (high[f] - low[f])
            grid[f, ..., axis] = height
            grid[f, ..., first] = span[:, None, 0]
            grid[f, ..., second] = span[None, :, 1]
        poles = np.einsum("ij,kl,fjlx->fikx", inverse, inverse, mapping(grid))
        planes = none
        ends = np.array([n + 1, n + 1])
        surfaces = (
            Surfaces(
                np.arange(face_count),
                (n, n),
                np.stack([low[:, 0], high[:, 0]], axis=1),
                np.stack([low[:, 1], high[:, 1]], axis=1),
                ends,
                ends,
                poles,
            ),
        )
    curve = Curves(
        np.arange(count),
        n,
        np.tile([0.0, 1.0], (count, 1)),
        np.array([n + 1, n + 1]),
        curve_poles,
    )
    shell_solid = np.array(shell_solid)
    return Brep(
        points=image,
        edges=edges,
        curves=(curve,),
        surfaces=surfaces,
        planes=planes,
        face_surface=np.arange(face_count),
        face_reversed=np.array(reverse),
        face_loops=np.r_[0, np.cumsum(face_sizes)],
        loop_coedges=np.r_[0, np.cumsum(loop_sizes)],
        coedge_edge=np.array(coedges),
        coedge_forward=np.array(forward),
        pcurves=np.array(pcurves, dtype=float),
        face_shell=np.zeros(face_count, int) if face_shell is None else np.array(face_shell),
        shell_closed=np.array([True] * len(shell_solid) if shell_closed is None else shell_closed),
        shell_solid=shell_solid,
        edge_tolerance=np.full(count, tolerance),
        vertex_tolerance=np.full(len(points), tolerance),
    )


def cube(mapping: Mapping | None = None, **options: object) -> Brep:
    """The unit cube: 6 faces, 12 edges, 8 vertices."""
    return axis_brep(UNIT_CUBE, CUBE_FACES, mapping, **options)  # type: ignore[arg-type]


def cube_with_cavity(mapping: Mapping | None = None) -> Brep:
    """The unit cube with a cubic hollow from 0.25 to 0.75, as one solid of two shells."""
    inner = [[[8 + v for v in reversed(loops[0])]] for loops in CUBE_FACES]
    return axis_brep(
        np.concatenate([UNIT_CUBE, 0.25 + 0.5 * UNIT_CUBE]),
        CUBE_FACES + inner,
        mapping,
        face_shell=[0] * 6 + [1] * 6,
        shell_solid=(0, 0),
    )


def plate_with_hole(mapping: Mapping | None = None, degree: int = 3) -> Brep:
    """A 1 × 1 × 0.25 plate with a square hole through it: two of its ten faces have a hole."""
    thin = np.array([1.0, 1.0, 0.25])
    hole = UNIT_CUBE * [0.5, 0.5, 1.0] + [0.25, 0.25, 0.0]
    outer = [list(map(list, loops)) for loops in CUBE_FACES]
    inner = [[8 + v for v in reversed(loops[0])] for loops in CUBE_FACES]
    outer[4].append(inner[4])
    outer[5].append(inner[5])
    return axis_brep(
        np.concatenate([UNIT_CUBE, hole]) * thin,
        outer + [[loop] for loop in inner[:4]],
        mapping,
        degree=degree,
    )


def split_cube(mapping: Mapping | None = None) -> Brep:
    """The unit cube with its top (+z) in two faces that trim one surface: 7 faces, 15 edges."""
    points = np.concatenate([UNIT_CUBE, [[0.5, 0.0, 1.0], [0.5, 1.0, 1.0]]])
    front, back = [[0, 4, 5, 8, 1]], [[2, 3, 9, 7, 6]]
    faces = [CUBE_FACES[0], CUBE_FACES[1], front, back, CUBE_FACES[4]]
    brep = axis_brep(points, [*faces, [[1, 8, 9, 3]], [[8, 5, 7, 9]]], mapping)
    whole = cube(mapping)
    return replace(
        brep,
        surfaces=whole.surfaces,
        planes=whole.planes,
        face_surface=np.array([0, 1, 2, 3, 4, 5, 5]),
    )


def bridged_plate(mapping: Mapping | None = None) -> Brep:
    """The plate with a hole whose top is one loop: an edge leads to the hole and back again."""
    thin = np.array([1.0, 1.0, 0.25])
    hole = UNIT_CUBE * [0.5, 0.5, 1.0] + [0.25, 0.25, 0.0]
    outer = [list(map(list, loops)) for loops in CUBE_FACES]
    inner = [[8 + v for v in reversed(loops[0])] for loops in CUBE_FACES]
    outer[4].append(inner[4])
    # From corner 1 across to the hole's corner 9, round the hole, back, and round the outside.
    start = inner[5].index(9)
    around = inner[5][start:] + inner[5][:start]
    outer[5] = [[1, 9, *around[1:], 9, 1, *CUBE_FACES[5][0][1:]]]
    return axis_brep(
        np.concatenate([UNIT_CUBE, hole]) * thin, outer + [[loop] for loop in inner[:4]], mapping
    )


def tube() -> Brep:
    """An open tube of one face that closes on itself along a seam: 3 edges, 2 vertices."""
    ring = np.array([[0, 0], [2, 0], [3, 2], [-3, 2], [-2, 0], [0, 0]], dtype=float)
    poles = np.zeros((6, 2, 3))
    poles[..., :2] = ring[:, None]
    poles[:, 1, 2] = 1
    knots, mults = np.array([0.0, 0.5, 0.75, 1.0]), np.array([4, 1, 1, 4])
    ends = np.array([[0.0, 1.0]])
    return Brep(
        points=poles[0],
        edges=np.array([[0, 1], [0, 0], [1, 1]]),
        curves=(
            Curves(np.array([0]), 1, ends, np.array([2, 2]), poles[None, 0]),
            Curves(np.array([1, 2]), 3, np.tile(knots, (2, 1)), mults, poles.swapaxes(0, 1)),
        ),
        surfaces=(
            Surfaces(
                np.array([0]), (3, 1), knots[None], ends, mults, np.array([2, 2]), poles[None]
            ),
        ),
        planes=Planes(np.zeros(0, int), *(np.zeros((0, 3)) for _ in range(3))),
        face_surface=np.array([0]),
        face_reversed=np.array([False]),
        face_loops=np.array([0, 1]),
        loop_coedges=np.array([0, 4]),
        coedge_edge=np.array([1, 0, 2, 0]),
        coedge_forward=np.array([True, True, False, False]),
        pcurves=np.array(
            [[[0, 0], [1, 0]], [[1, 0], [1, 1]], [[0, 1], [1, 1]], [[0, 0], [0, 1]]], dtype=float
        ),
        face_shell=np.array([0]),
        shell_closed=np.array([False]),
        shell_solid=np.array([-1]),
        edge_tolerance=np.full(3, 1e-7),
        vertex_tolerance=np.full(2, 1e-7),
    )


def flip_face(brep: Brep, face: int) -> Brep:
    """Turn one face inside out: its normal reversed and its loops run the other way."""
    edge, forward = brep.coedge_edge.copy(), brep.coedge_forward.copy()
    pcurves, reverse = brep.pcurves.copy(), brep.face_reversed.copy()
    reverse[face] ^= True
    for loop in range(brep.face_loops[face], brep.face_loops[face + 1]):
        run = slice(brep.loop_coedges[loop], brep.loop_coedges[loop + 1])
        edge[run], pcurves[run] = edge[run][::-1].copy(), pcurves[run][::-1].copy()
        forward[run] = ~forward[run][::-1]
    return replace(
        brep, coedge_edge=edge, coedge_forward=forward, pcurves=pcurves, face_reversed=reverse
    )


def turn_inside_out(brep: Brep) -> Brep:
    """Flip every face."""
    for face in range(brep.face_count):
        brep = flip_face(brep, face)
    return brep


def without_last_face(brep: Brep) -> Brep:
    """Leave the last face out; the shell still claims to be closed."""
    loops = brep.face_loops[-2]
    coedges = brep.loop_coedges[loops]
    return replace(
        brep,
        face_surface=brep.face_surface[:-1],
        face_reversed=brep.face_reversed[:-1],
        face_loops=brep.face_loops[:-1],
        loop_coedges=brep.loop_coedges[: loops + 1],
        coedge_edge=brep.coedge_edge[:coedges],
        coedge_forward=brep.coedge_forward[:coedges],
        pcurves=brep.pcurves[:coedges],
        face_shell=brep.face_shell[:-1],
    )


def grid_of_cubes(n: int, mapping: Mapping | None = None, degree: int = 3) -> Brep:
    """``n`` separate small cubes in a row, each a solid: a model of ``6 n`` faces."""
    points = np.concatenate([(UNIT_CUBE * 0.5 + [i, 0, 0]) / n for i in range(n)])
    faces = [[[8 * i + v for v in loops[0]]] for i in range(n) for loops in CUBE_FACES]
    return axis_brep(
        points,
        faces,
        mapping,
        degree=degree,
        face_shell=np.repeat(np.arange(n), 6).tolist(),
        shell_solid=range(n),
    )


RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.25, 1.0)
MATERIALS = (Material("red", RED), Material("it's blue", BLUE), Material("bare"))


def labelled(bodies, faces=6):
    """Labels for every face of some bodies, two materials and a mass each."""
    return ShapeLabels(
        "whole",
        MATERIALS,
        tuple(
            BodyLabels(
                f"body {number}",
                tuple(f"face {number}.{face}" for face in range(faces)),
                tuple((number + face) % 2 for face in range(faces)),
                MassProperties(1.5 + number, 7.25, (1.0, 2.0, 3.0)),
            )
            for number in range(bodies)
        ),
    )
