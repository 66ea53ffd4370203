"""Triangles of a surface and the nearest places on them, against brute force."""

import numpy as np

from ffdcli.scan.record import Scan
from ffdcli.scan.samples import take_samples
from ffdcli.scan.surface import divide, nearest_places, spread_out

RANDOM = np.random.default_rng(11)


def test_parts_fill_their_triangle():
    corners = RANDOM.normal(size=(5, 3, 3))
    parts, owner = divide(corners, 0.4)
    edges = np.linalg.norm(parts - np.roll(parts, 1, axis=1), axis=2)
    assert edges.max() <= 0.4

    def vectors(each):
        return np.cross(each[:, 1] - each[:, 0], each[:, 2] - each[:, 0])

    sums = np.stack([np.bincount(owner, column) for column in vectors(parts).T], axis=1)
    np.testing.assert_allclose(sums, vectors(corners), atol=1e-12)
    alike = np.einsum("tc,tc->t", vectors(parts), vectors(corners)[owner])
    assert alike.min() > 0


def test_the_nearest_place_is_the_nearest_of_a_dense_sample():
    large, small = RANDOM.normal(size=(2, 3, 3)), RANDOM.normal(size=(40, 3, 3)) * 0.1
    parts = np.concatenate([divide(large, 0.6)[0], small])
    points = RANDOM.normal(size=(30, 3))
    found = nearest_places(points, parts)
    grid = np.array([(i, j, 40 - i - j) for i in range(41) for j in range(41 - i)]) / 40
    dense = np.einsum("gb,tbc->tgc", grid, parts).reshape(-1, 3)
    least = np.linalg.norm(points[:, None] - dense, axis=2).min(axis=1)
    assert np.all(found.distance <= least + 1e-12)
    assert np.abs(found.distance - least).max() < 0.01
    places = (found.shares[:, :, None] * parts[found.triangle]).sum(axis=1)
    np.testing.assert_allclose(places, found.points, atol=1e-9)


def test_triangles_left_out_leave_the_others_evenly_spread():
    parts, _ = divide(np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], dtype=float), 0.02)
    few = spread_out(parts, 500)
    assert len(few) <= 500
    np.testing.assert_allclose(few.mean(axis=(0, 1)), [1 / 3, 1 / 3, 0], atol=0.01)


def test_normals_of_points_are_those_of_the_surface_and_lines_have_none():
    sphere = RANDOM.normal(size=(3000, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    none = np.zeros((0, 3), dtype=np.int64)
    found = take_samples(Scan(sphere, none))
    cosine = np.abs(np.einsum("nc,nc->n", found.normals, found.points))
    assert np.median(cosine) > 0.999
    line = np.linspace([0, 0, 0], [1, 2, 3], 100)
    assert not take_samples(Scan(line, none)).normals.any()


def test_places_beside_a_scan_with_a_border_are_told():
    n = 21
    grid = np.stack(np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij"), axis=2)
    points = np.column_stack([grid.reshape(-1, 2), np.zeros(n * n)])
    at = np.arange(n * n).reshape(n, n)
    low, high = (at[:-1, :-1], at[1:, :-1], at[1:, 1:]), (at[:-1, :-1], at[1:, 1:], at[:-1, 1:])
    faces = np.concatenate([np.stack(each, axis=2).reshape(-1, 3) for each in (low, high)])
    samples = take_samples(Scan(points, faces))
    places = np.array([[0.5, 0.52, 0.01], [1.02, 0.5, 0.0], [0.98, 0.5, -0.02], [3.0, 0.5, 0.0]])
    gaps, beside = samples.gaps(places, np.tile([0.0, 0.0, 1.0], (4, 1)))
    np.testing.assert_allclose(gaps, [0.01, 0.02, 0.02, 2.0], atol=1e-12)
    assert beside.tolist() == [False, True, False, True]
