"""Control points of surfaces and curves against exact rational arithmetic."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from ffdcli.surface.patches import PatchBatch
from ffdcli.volume.bspline import BSplineVolume
from support.surface_exact import curve_poles, surface_poles
from support.surface_models import Stages, box_mesh, make_volume, run, turn, zoo

_ZOO_BODY_TRIANGLES = 12
_FIRST_STRIP = 5


def uneven(degree: int, count: int, seed: int) -> np.ndarray:
    """Uneven interior knots, some repeated up to the degree."""
    rng = np.random.default_rng(seed)
    steps = rng.uniform(0.2, 1.0, count)
    places = np.cumsum(steps)[:-1] / steps.sum()
    needed = count - degree - 1
    mults: list[int] = []
    while sum(mults) < needed:
        mults.append(min(int(rng.integers(1, degree + 1)), needed - sum(mults)))
    chosen = np.sort(rng.choice(places, len(mults), replace=False))
    return np.repeat(chosen, mults)


def classes(stages: Stages) -> dict[str, list[tuple[PatchBatch, int]]]:
    """Patches by the axes along which their normal has a component; strips apart."""
    out: dict[str, list[tuple[PatchBatch, int]]] = {}
    body = np.empty(len(stages.groups.normal), dtype=int)
    body[stages.groups.group] = np.arange(len(stages.triangles)) // _ZOO_BODY_TRIANGLES
    for batch in stages.patches:
        axes = [batch.order[0]]
        axes += [axis for axis, on in zip(batch.order[1:], batch.sloping, strict=True) if on]
        kind = "".join("uvw"[axis] for axis in sorted(axes))
        for i, patch in enumerate(batch.patches):
            strip = body[stages.parts.group[patch]] >= _FIRST_STRIP
            out.setdefault("strip" if strip else kind, []).append((batch, i))
    return out


def measure_surfaces(stages: Stages, each: int, seed: int = 0) -> dict[str, float]:
    """Largest error of control points in a sample of every class, over the largest coordinate."""
    rng = np.random.default_rng(seed)
    worst: dict[str, float] = {}
    for kind, members in classes(stages).items():
        for pick in rng.choice(len(members), min(each, len(members)), replace=False):
            batch, i = members[pick]
            poles = batch.control_points(stages.volume.net, np.array([i]))[0]
            cell = (int(rng.integers(batch.shape[0])), int(rng.integers(batch.shape[1])))
            exact, place = surface_poles(stages.volume, stages.parts.graphs, batch, i, cell)
            worst[kind] = max(worst.get(kind, 0.0), exact.gap(poles[place]) / largest(stages))
    return worst


def measure_curves(stages: Stages, each: int, seed: int = 0) -> float:
    """The same for edge curves: ``each`` of every batch."""
    rng = np.random.default_rng(seed)
    worst = 0.0
    for batch in stages.curves:
        for i in rng.choice(len(batch.edges), min(each, len(batch.edges)), replace=False):
            poles = batch.control_points(stages.volume.net, np.array([i]))[0]
            start, end = stages.places[stages.outlines.edges[batch.edges[i]]]
            piece = int(rng.integers(batch.shape[0]))
            exact, place = curve_poles(stages.volume, start, end, batch, int(i), piece)
            worst = max(worst, exact.gap(poles[place]) / largest(stages))
    return worst


def largest(stages: Stages) -> float:
    """Largest coordinate of the box-centred model."""
    low, high = stages.vertices.min(axis=0), stages.vertices.max(axis=0)
    return float((high - low).max() / 2)


def limit(degrees: tuple[int, int, int]) -> float:
    """A tenth of the design's target."""
    return 1e-13 if max(degrees) <= 3 else 1e-12


def furthest_pole(stages: Stages) -> float:
    """Largest distance of a surface's control point from the deformed vertices, in box sizes."""
    volume = stages.volume
    inside = np.clip(stages.places, volume.box[0], volume.box[1])
    solid = cKDTree(volume.evaluate(inside))
    worst = 0.0
    for batch in stages.patches:
        poles = batch.control_points(volume.net, np.arange(len(batch.patches)))
        worst = max(worst, float(solid.query(poles.reshape(-1, 3))[0].max()))
    return worst / float(np.linalg.norm(volume.box[1] - volume.box[0]))


def check(stages: Stages, each: int) -> None:
    errors = measure_surfaces(stages, each)
    degrees = stages.volume.degrees
    assert set(errors) == {"u", "v", "w", "uv", "uw", "vw", "uvw", "strip"}
    assert max(errors.values()) <= limit(degrees), errors
    assert measure_curves(stages, 1) <= limit(degrees)
    assert furthest_pole(stages) <= 2


MIXES = [
    ((1, 1, 1), (4, 7, 5), True, False),
    ((2, 2, 2), (4, 5, 16), False, False),
    ((2, 2, 2), (7, 8, 6), True, True),
    ((3, 3, 3), (16, 16, 16), True, False),
    ((3, 3, 3), (8, 9, 7), False, True),
    ((4, 4, 4), (16, 16, 16), True, False),
    ((4, 4, 4), (9, 10, 11), True, True),
    ((4, 4, 4), (5, 7, 16), False, False),
    ((1, 2, 3), (5, 8, 6), True, True),
    ((4, 3, 1), (9, 6, 6), False, True),
    ((2, 4, 3), (12, 8, 5), True, False),
    ((3, 1, 4), (4, 2, 6), False, False),
]


@pytest.mark.parametrize(("degrees", "counts", "clamped", "repeated"), MIXES)
def test_poles_are_exact_for_all_kinds_of_normal(
    degrees: tuple[int, int, int], counts: tuple[int, int, int], clamped: bool, repeated: bool
) -> None:
    interior = None
    if repeated:
        made = [uneven(k, n, 7 * i) for i, (k, n) in enumerate(zip(degrees, counts, strict=True))]
        interior = (made[0], made[1], made[2])
    volume = make_volume(-0.5, 0.5, degrees, counts, clamped=clamped, interior=interior)
    check(run(*zoo(), volume), each=4)


def test_poles_are_exact_away_from_the_origin() -> None:
    vertices, triangles = zoo()
    shift = np.array([1.3, -0.7, 2.1])
    vertices = vertices + shift
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    check(run(vertices, triangles, make_volume(low, high, (3, 3, 3), (7, 6, 5))), each=3)


def test_poles_are_exact_in_the_papers_partition() -> None:
    volume = make_volume(-0.5, 0.5, (2, 3, 2), (5, 6, 4))
    stages = run(*zoo(), volume, patches="bezier")
    assert all(batch.shape == (1, 1) for batch in stages.patches)
    check(stages, each=3)


@pytest.mark.sweep
@pytest.mark.parametrize("degrees", list(itertools.product(range(1, 5), repeat=3)))
def test_poles_are_exact_for_every_mix_of_degrees(degrees: tuple[int, int, int]) -> None:
    rng = np.random.default_rng(degrees)
    for clamped, repeated in itertools.product((True, False), repeat=2):
        counts = tuple(int(rng.integers(k + 1, 17)) for k in degrees)
        interior = None
        if repeated:
            made = [uneven(k, n, i) for i, (k, n) in enumerate(zip(degrees, counts, strict=True))]
            interior = (made[0], made[1], made[2])
        volume = make_volume(
            -0.5, 0.5, degrees, (counts[0], counts[1], counts[2]), clamped=clamped,
            interior=interior, seed=sum(degrees),
        )  # fmt: skip
        check(run(*zoo(), volume), each=4)


def collocate(stages: Stages, batch: PatchBatch, i: int, *, uniform: bool = False) -> np.ndarray:
    """Control points by sampling and two linear systems (Feng 2002, Eq. 3 and 4)."""
    volume = stages.volume
    a, b, c = batch.order
    full, sites = [], []
    for breaks, mults, degree in zip(batch.breaks, batch.mults, batch.degrees, strict=True):
        counts = np.concatenate([[degree + 1], mults, [degree + 1]])
        knots = np.repeat(breaks[i], counts)
        full.append(knots)
        count = len(knots) - degree - 1
        if uniform:
            sites.append(np.linspace(knots[0], knots[-1], count))
        else:
            means = [knots[j + 1 : j + degree + 1].mean() for j in range(count)]
            sites.append(np.clip(means, knots[0], knots[-1]))
    grid_b, grid_c = np.meshgrid(*sites, indexing="ij")
    height = stages.parts.graphs.height(batch.patches[[i]], grid_b[None], grid_c[None])[0]
    # One slab's polynomial, continued, where both slopes differ from 0; else the box holds it all.
    k, knots = volume.degrees[a], volume.knots[a]
    if all(batch.sloping):
        m = int(batch.cells[i * batch.shape[0] * batch.shape[1], a])
        piece = BSpline(knots[m - k : m + k + 2], np.eye(k + 1), k, extrapolate=True)
        weights_a = np.zeros((height.size, volume.shape[a]))
        weights_a[:, m - k : m + 1] = piece(height.ravel())
    else:
        inside = np.clip(height.ravel(), knots[k], knots[-k - 1])
        weights_a = BSpline.design_matrix(inside, knots, k).toarray()
    weights_a = weights_a.reshape(*height.shape, -1)
    weights_b = BSpline.design_matrix(sites[0], volume.knots[b], volume.degrees[b]).toarray()
    weights_c = BSpline.design_matrix(sites[1], volume.knots[c], volume.degrees[c]).toarray()
    net = volume.net.transpose(a, b, c, 3)
    values = np.einsum("stx,sy,tz,xyzd->std", weights_a, weights_b, weights_c, net, optimize=True)
    for axis in range(2):
        matrix = BSpline.design_matrix(sites[axis], full[axis], batch.degrees[axis]).toarray()
        values = np.moveaxis(values, axis, 0)
        solved = np.linalg.solve(matrix, values.reshape(len(matrix), -1))
        values = np.moveaxis(solved.reshape(values.shape), 0, axis)
    return values


def test_collocation_agrees_at_its_own_accuracy() -> None:
    for degrees, counts in [((2, 2, 2), (5, 6, 4)), ((3, 3, 3), (6, 5, 7)), ((1, 3, 2), (4, 7, 5))]:
        stages = run(*zoo(), make_volume(-0.5, 0.5, degrees, counts))
        for members in classes(stages).values():
            for batch, i in members[:2]:
                poles = batch.control_points(stages.volume.net, np.array([i]))[0]
                assert np.abs(collocate(stages, batch, i) - poles).max() <= 1e-9


@pytest.mark.parametrize("degree", [3, 4])
def test_product_form_keeps_digits_that_collocation_loses(degree: int) -> None:
    """One Bézier patch of 6x6 and 8x8: why the product form does the work.

    Measured: 8e-16 against 7e-13 for 6x6, 1.1e-15 against 2.9e-11 for 8x8.
    """
    k = (degree, degree, degree)
    rotated = box_mesh(0.54, turn([0.3, -0.5, 0.8], 0.83))
    volume = make_volume(-0.5, 0.5, k, (degree + 1, degree + 1, degree + 1), amount=0.2)
    stages = run(*rotated, volume)
    product, colloc = one_patch_errors(stages, volume)
    assert product <= 4e-15
    assert 50 * product < colloc


def one_patch_errors(stages: Stages, volume: BSplineVolume) -> tuple[float, float]:
    product = colloc = 0.0
    for batch in stages.patches:
        for i in range(len(batch.patches)):
            exact, _ = surface_poles(volume, stages.parts.graphs, batch, i, (0, 0))
            poles = batch.control_points(volume.net, np.array([i]))[0]
            product = max(product, exact.gap(poles) / largest(stages))
            sampled = collocate(stages, batch, i, uniform=True)
            colloc = max(colloc, exact.gap(sampled) / largest(stages))
    return product, colloc


def test_poles_agree_with_another_library() -> None:
    """splinepy composes the full-degree Bézier patch by its own algorithm."""
    splinepy = pytest.importorskip("splinepy")
    volume = make_volume(-1.0, 1.0, (2, 3, 2), (3, 4, 3), amount=0.2)
    stages = run(*box_mesh(0.54, turn([0.3, -0.5, 0.8], 0.83)), volume)
    control = volume.net.transpose(2, 1, 0, 3).reshape(-1, 3)
    outer = splinepy.Bezier(degrees=volume.degrees, control_points=control)
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 5)] * 2, indexing="ij"), -1).reshape(-1, 2)
    for batch in stages.patches:
        poles = batch.control_points(volume.net, np.arange(len(batch.patches)))
        for i, patch in enumerate(batch.patches):
            ends = [breaks[i, [0, -1]] for breaks in batch.breaks]
            corner = np.empty((2, 2, 3))
            corner[:, :, batch.order[1]] = ends[0][:, None]
            corner[:, :, batch.order[2]] = ends[1][None, :]
            corner[:, :, batch.order[0]] = stages.parts.graphs.height(
                patch[None], corner[None, :, :, batch.order[1]], corner[None, :, :, batch.order[2]]
            )[0]
            shares = (corner.transpose(1, 0, 2).reshape(-1, 3) + 1) / 2
            inner = splinepy.Bezier(degrees=[1, 1], control_points=shares)
            ours = splinepy.Bezier(
                degrees=batch.degrees, control_points=poles[i].transpose(1, 0, 2).reshape(-1, 3)
            )
            gap = outer.compose(inner).evaluate(grid) - ours.evaluate(grid)
            assert np.abs(gap).max() <= 1e-13
