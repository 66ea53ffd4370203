"""CAD parts made by hand as records: a cylinder, a ball with poles, a sheet; and their lattices."""

import numpy as np

from ffdcli.part.curves import BSplineCurve, Circle, Line
from ffdcli.part.record import Part
from ffdcli.part.surfaces import BSplineSurface, Cylinder, Plane, Sphere

from .lattice_models import settled

TURN = 2 * np.pi


def part_of(**given):
    """A part from its geometry, everything else filled in."""
    edges, coedges, faces = len(given["curves"]), len(given["coedge_edge"]), len(given["surfaces"])
    filled = {
        "vertex_tolerance": np.full(len(given["points"]), 1e-7),
        "edge_tolerance": np.full(edges, 1e-7),
        "degenerate": np.array([curve is None for curve in given["curves"]]),
        "same_parameter": np.ones(edges, dtype=bool),
        "face_tolerance": np.full(faces, 1e-7),
        "face_reversed": np.zeros(faces, dtype=bool),
        "coedge_forward": np.ones(coedges, dtype=bool),
        "seam": np.zeros(coedges, dtype=bool),
        "face_shell": np.zeros(faces, dtype=np.int64),
        "shell_closed": np.array([True]),
        "shell_solid": np.array([0]),
        "face_names": (None,) * faces,
        "solid_names": (None,),
        "unit": "mm",
    }
    return Part(**{**filled, **given})


def cylinder(radius=2.0, height=5.0):
    """A cylinder that stands on the origin: its side with a seam, its foot, its top."""
    x, y, z = np.eye(3)
    top = height * z
    side = Cylinder(np.zeros(3), x, y, z, radius)
    discs = [Plane(at, x, y, z) for at in (np.zeros(3), top)]
    rims = [Circle(at, x, y, radius, radius) for at in (np.zeros(3), top)]
    ring = Circle(np.zeros(2), x[:2], y[:2], radius, radius)
    u, v = np.eye(2)
    pcurves = [
        Line(np.zeros(2), u), Line(np.array([TURN, 0]), v),
        Line(np.array([0, height]), u), Line(np.zeros(2), v), ring, ring,
    ]  # fmt: skip
    disc = np.array([[-radius, -radius], [radius, radius]])
    return part_of(
        points=np.array([[radius, 0, 0], [radius, 0, height]]),
        edges=np.array([[0, 0], [1, 1], [0, 1]]),
        curves=(*rims, Line(np.array([radius, 0, 0]), z)),
        edge_range=np.array([[0, TURN], [0, TURN], [0, height]]),
        surfaces=(side, *discs),
        rectangles=np.array([[[0, 0], [TURN, height]], disc, disc]),
        face_loops=np.array([0, 1, 2, 3]),
        loop_coedges=np.array([0, 4, 5, 6]),
        coedge_edge=np.array([0, 2, 1, 2, 0, 1]),
        coedge_forward=np.array([True, True, False, False, False, True]),
        pcurves=tuple(pcurves),
        seam=np.array([False, True, False, True, False, False]),
        bounds=np.array([[-radius, -radius, 0], [radius, radius, height]]),
    )


def ball(radius=2.0):
    """A sphere round the origin, with two poles and a seam."""
    x, y, z = np.eye(3)
    south, north = np.array([0, -np.pi / 2]), np.array([0, np.pi / 2])
    u, v = np.eye(2)
    return part_of(
        points=np.array([-radius * z, radius * z]),
        edges=np.array([[0, 0], [0, 1], [1, 1]]),
        curves=(None, Circle(np.zeros(3), x, z, radius, radius), None),
        edge_range=np.array([[0, TURN], [-np.pi / 2, np.pi / 2], [0, TURN]]),
        surfaces=(Sphere(np.zeros(3), x, y, z, radius),),
        rectangles=np.array([[south, [TURN, np.pi / 2]]]),
        face_loops=np.array([0, 1]),
        loop_coedges=np.array([0, 4]),
        coedge_edge=np.array([0, 1, 2, 1]),
        coedge_forward=np.array([True, True, False, False]),
        pcurves=(Line(south, u), Line(TURN * u, v), Line(north, u), Line(np.zeros(2), v)),
        seam=np.array([False, True, False, True]),
        bounds=radius * np.array([[-1.0, -1, -1], [1, 1, 1]]),
    )


def sheet(rational=False):
    """A wavy B-spline patch with its four edges."""
    rng = np.random.default_rng(3)
    flat = np.stack(np.meshgrid(np.linspace(0, 3, 6), np.linspace(0, 2, 5), indexing="ij"), -1)
    poles = np.concatenate([flat, 0.5 * rng.random((6, 5, 1))], axis=-1)
    weights = rng.uniform(0.7, 1.4, (6, 5)) if rational else None
    knots = (
        np.repeat([0.0, 0.4, 0.7, 1.0], [4, 1, 1, 4]),
        np.repeat([0.0, 0.5, 1.0], [3, 2, 3]),
    )
    surface = BSplineSurface((3, 2), knots, poles, weights)

    def side(degree, axis, row):
        part = None if weights is None else weights[row]
        return BSplineCurve(degree, knots[axis], poles[row], part)

    rows = [(3, 0, np.s_[:, 0]), (2, 1, np.s_[-1]), (3, 0, np.s_[:, -1]), (2, 1, np.s_[0])]
    u, v = np.eye(2)
    corners = surface.points(np.array([0.0, 1, 1, 0]), np.array([0.0, 0, 1, 1]))
    return part_of(
        points=corners,
        edges=np.array([[0, 1], [1, 2], [3, 2], [0, 3]]),
        curves=tuple(side(*row) for row in rows),
        edge_range=np.tile([0.0, 1.0], (4, 1)),
        surfaces=(surface,),
        rectangles=np.array([[[0.0, 0], [1, 1]]]),
        face_loops=np.array([0, 1]),
        loop_coedges=np.array([0, 4]),
        coedge_edge=np.arange(4),
        coedge_forward=np.array([True, True, False, False]),
        pcurves=(Line(0 * u, u), Line(u, v), Line(v, u), Line(0 * u, v)),
        shell_closed=np.array([False]),
        shell_solid=np.array([-1]),
        bounds=np.array([poles.min(axis=(0, 1)), poles.max(axis=(0, 1))]),
    )


def lattice_for(part, amount=0.3, seed=0, **keys):
    """A cubic lattice round a part, or another, its free control points moved at random."""
    if "octree" not in keys:
        keys = {"points": [5, 5, 6], **keys}
    keys = {"volume": "bspline", "degree": [3, 3, 3], **keys}
    found = settled(*part.bounds, delta=1e-9 * part.size, **keys)
    rng = np.random.default_rng(seed)
    moves = amount * rng.uniform(-1, 1, found.points.shape)
    member = found.member
    fixed = found.locked | (member.map.levels > 0)
    return found.with_net(found.points + np.where(fixed[..., None], 0, moves))
