"""Tests for contact of convex bodies with boxes, for many pairs at once."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats


def touches_boxes(
    corners: Floats, normals: Floats, edges: Floats, low: Floats, high: Floats
) -> Bools:
    """Test which convex bodies touch their boxes, sides included.

    By the separating axis theorem: the directions are the normals of both bodies and the cross
    products of their edges; convex bodies that none of them separates touch.

    Parameters
    ----------
    corners : (m, p, 3) float64
    normals, edges : (m, a, 3), (m, e, 3) float64
        Directions of the body's faces and edges.
    low, high : (m or 1, 3) float64

    Returns
    -------
    (m,) bool
    """
    centre, half = (low + high) / 2, (high - low) / 2
    count = len(corners)
    box_axes = np.broadcast_to(np.eye(3), (count, 3, 3))
    products = np.cross(edges[:, :, None, :], np.eye(3)[None, None]).reshape(
        count, 3 * edges.shape[1], 3
    )
    directions = np.concatenate([box_axes, normals, products], axis=1)
    spans = np.einsum("mdc,mpc->mdp", directions, corners - centre[:, None, :])
    radius = np.einsum("mdc,mc->md", np.abs(directions), np.broadcast_to(half, (count, 3)))
    apart = (spans.min(axis=2) > radius) | (spans.max(axis=2) < -radius)
    return np.asarray(~apart.any(axis=1))


def triangle_directions(triangles: Floats) -> tuple[Floats, Floats]:
    """Normals (m, 1, 3) and edges (m, 3, 3) of triangles (m, 3, 3)."""
    edges = np.roll(triangles, -1, axis=1) - triangles
    return np.cross(edges[:, 0], edges[:, 1])[:, None, :], edges


def unit_directions(triangles: Floats) -> tuple[Floats, Floats]:
    """Unit normals (m, 1, 3) and edges (m, 3, 3), since products of small vectors underflow."""
    normals, edges = triangle_directions(triangles)
    normals = normals / np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-300)
    edges = edges / np.maximum(np.linalg.norm(edges, axis=2, keepdims=True), 1e-300)
    return normals, edges
