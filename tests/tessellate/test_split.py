"""Nets: splitting by any pattern of marks and flipping keep area, closedness and numbering."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.mesh.flip import flip_to_delaunay
from ffdcli.mesh.triangle_net import net_of_triangles
from ffdcli.tessellate.split import split
from support.jobs import CUBE, CUBE_FACES

FACES = np.repeat(np.arange(6), 2)


def areas(net):
    a, b, c = (net.rest[net.triangles[:, i]] for i in range(3))
    return np.cross(b - a, c - a) / 2


def require_sound(net):
    """Sides name the edges between their corners, and every edge is used once each way."""
    heads = np.roll(net.triangles, -1, axis=1)
    ends = np.sort(net.ends[net.sides], axis=2)
    np.testing.assert_array_equal(ends, np.sort(np.stack([net.triangles, heads], 2), axis=2))
    forward = net.ends[net.sides, 0] == net.triangles
    assert (np.bincount(net.sides[forward], minlength=len(net.ends)) == 1).all()
    assert (np.bincount(net.sides[~forward], minlength=len(net.ends)) == 1).all()
    assert len(net.rest) - len(net.ends) + len(net.triangles) == 2
    total = areas(net)
    per_face = np.stack([np.bincount(net.owner, weights=total[:, i]) for i in range(3)], 1)
    np.testing.assert_allclose(np.linalg.norm(per_face, axis=1), 1, rtol=1e-14)
    assert np.linalg.norm(total, axis=1).sum() == np.float64(6) or np.isclose(
        np.linalg.norm(total, axis=1).sum(), 6, rtol=1e-14
    )


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 1.0))
def test_any_marks_leave_a_sound_net(seed, share):
    random = np.random.default_rng(seed)
    net = net_of_triangles(CUBE, CUBE_FACES, FACES)
    for _ in range(3):
        marked = random.random(len(net.ends)) < share
        before = net
        net, origin = split(net, marked, net.rest + 0.1 * random.random(net.rest.shape))
        assert len(net.rest) == len(before.rest) + marked.sum()
        np.testing.assert_array_equal(net.owner, before.owner[origin])
        np.testing.assert_array_equal(net.rest[: len(before.rest)], before.rest)
        require_sound(net)
    flipped, changed = flip_to_delaunay(net)
    require_sound(flipped)
    same = (flipped.triangles == net.triangles).all(axis=1)
    assert same[~changed].all()


def test_halving_all_edges_quarters_triangles():
    net = net_of_triangles(CUBE, CUBE_FACES, FACES)
    finer, origin = split(net, np.ones(len(net.ends), dtype=bool), net.rest)
    assert len(finer.triangles) == 48
    assert (np.bincount(origin) == 4).all()
    np.testing.assert_allclose(np.linalg.norm(areas(finer), axis=1), 0.125)


def test_flips_make_flat_faces_delaunay():
    """No vertex of a face lies inside the circle round any of its triangles."""
    random = np.random.default_rng(3)
    net = net_of_triangles(CUBE, CUBE_FACES, FACES)
    for _ in range(4):
        net, _ = split(net, random.random(len(net.ends)) < 0.4, net.rest)
    flipped, changed = flip_to_delaunay(net)
    assert changed.any()
    for face in range(6):
        rows = flipped.triangles[flipped.owner == face]
        points = flipped.rest[np.unique(rows)]
        for a, b, c in flipped.rest[rows]:
            u, v = b - a, c - a
            w = np.cross(u, v)
            centre = (u @ u * np.cross(v, w) + v @ v * np.cross(w, u)) / (2 * w @ w)
            radius = np.linalg.norm(centre)
            assert (np.linalg.norm(points - a - centre, axis=1) >= radius * (1 - 1e-9)).all()
    again, changed = flip_to_delaunay(flipped)
    assert not changed.any()
    assert again.triangles is flipped.triangles
