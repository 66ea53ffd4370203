"""Triangles near to points: needles that pass by, found among thousands."""

from __future__ import annotations

import numpy as np

from ffdcli.verify.nearest_on_deformed_mesh import CANDIDATES, nearest_triangles


def fan(count: int) -> np.ndarray:
    """A disc of radius 100 as needles from a point near its border."""
    angle = np.linspace(0, 2 * np.pi, count + 1)
    ring = 100 * np.stack([np.cos(angle), np.sin(angle), np.zeros(count + 1)], axis=1)
    hub = np.broadcast_to([90.0, 10.0, 0.0], (count, 3))
    return np.stack([hub, ring[:-1], ring[1:]], axis=1)


def test_points_of_needles_find_their_own_needle():
    random = np.random.default_rng(3)
    corners = fan(3000)
    own = random.integers(0, len(corners), 4000)
    weights = random.dirichlet([1, 1, 1], len(own))
    points = np.einsum("nk,nkx->nx", weights, corners[own])
    points[:, 2] += random.uniform(-1e-3, 1e-3, len(points))
    triangle, params = nearest_triangles(corners, points)
    assert triangle.shape == (len(points), CANDIDATES)
    first = corners[triangle[:, 0]]
    foot = first[:, 0] + np.einsum("nk,nkx->nx", params[:, 0], first[:, 1:] - first[:, :1])
    away = np.linalg.norm(points - foot, axis=1)
    assert np.abs(away - np.abs(points[:, 2])).max() < 1e-9
    assert (triangle[:, 0] == own).mean() > 0.99


def test_a_point_far_from_all_triangles_has_candidates_too():
    triangle, params = nearest_triangles(fan(4), np.array([[0.0, 0.0, 500.0]]))
    assert sorted(triangle[0].tolist()) == [-1, -1, 0, 1, 2, 3]
    assert np.all((params >= 0) & (params.sum(axis=2, keepdims=True) <= 1 + 1e-12))
