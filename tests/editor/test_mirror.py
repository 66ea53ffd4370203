"""Symmetric edits: what they do to the model is its own mirror image."""

import numpy as np
import pytest

from ffdcli.editor import Plane
from ffdcli.errors import LatticeError
from support.editor_models import session_of

OCTREE = "version: 1\nvolume: hierarchical\noctree: {depth: 2}\n"


def require_symmetric(session, plane, edits, n=None):
    """The drawn model after the edits is symmetric about the plane."""
    session.append(*edits, n=n)
    points = np.random.default_rng(3).uniform([0, 0, 0], [4, 3, 2], (200, 3))
    images = session.image(points)
    others = session.image(plane.points(points))
    assert np.abs(plane.points(images) - others).max() < 1e-5 * session.size
    assert np.abs(images - points).max() > 1e-2
    session.undo()


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("text", ["version: 1\n", OCTREE], ids=["rows", "octree"])
def test_edits_of_all_kinds_and_their_mirror_images(tmp_path, axis, text):
    with session_of(tmp_path, text) as session:
        plane = Plane.of_axis(axis, session.bounds)
        net, rng = session.nets[0], np.random.default_rng(5)
        mask = net.free & (rng.random(net.count) < 0.2)
        near = net.free & (plane.distance(net.rest) > 0.1) & (rng.random(net.count) < 0.3)
        for edits in (
            session.drag([[3, 2.5, 1.5]], by=[[0.2, 0.1, 0.3]], plane=plane),
            session.move(mask, [0.1, 0.2, 0.3], plane=plane),
            session.transform(near, scale=[1.1, 0.9, 1.2], plane=plane),
            session.transform(near, rotate=("u", 10), plane=plane),
            session.transform(near, rotate=("w", 10), translate=[0.1, 0, 0.2], plane=plane),
            session.transform(near, scale=[1, 1.3, 1], center=[1, 0.5, 0.25], plane=plane),
        ):
            require_symmetric(session, plane, edits)


def test_points_on_the_plane_stay_on_it(tmp_path):
    with session_of(tmp_path) as session:
        plane = Plane.of_axis("x", session.bounds)
        (edit,) = session.drag([[2, 1.5, 2]], by=[[0.3, 0.1, 0.4]], plane=plane)
        assert edit == {"drag": {"pairs": [{"from": [2, 1.5, 2], "by": [0, 0.1, 0.4]}]}}
        mask = session.slice_mask("w", -1)
        (edit, other) = session.transform(
            session.slice_mask("u", 0), rotate=("w", 10.0), plane=plane
        )
        assert other["transform"]["rotate"] == {"axis": "w", "angle": -10}
        # A layer that is its own mirror image moves along the plane.
        edits = session.move(mask, [0.2, 0, 0.3], plane=plane)
        require_symmetric(session, plane, edits)


def test_weights_and_peaks_come_in_pairs(tmp_path):
    with session_of(tmp_path, "version: 1\nvolume: nurbs\n") as session:
        plane = Plane.of_axis("y", session.bounds)
        mask = np.zeros(session.nets[0].shape, dtype=bool)
        mask[2, 1, 3] = True
        require_symmetric(session, plane, [
            *session.move(session.slice_mask("w", -1), [0, 0, 0.5]),
            *session.weight(mask.ravel(), 3, plane=plane),
        ])  # fmt: skip
        edits = session.hammer([3, 2.5, 2], 0.3, plane=plane)
        assert [edit["hammer"]["point"] for edit in edits] == [[3, 2.5, 2], [3, 0.5, 2]]
        assert len(session.crimp([3, 1.5, 2], 2, plane=plane)) == 1


def test_a_lattice_that_is_not_symmetric_is_named(tmp_path):
    text = "version: 1\nbox: {min: [0, 0, 0], max: [5, 3, 2]}\n"
    with session_of(tmp_path, text) as session:
        plane = Plane.of_axis("x", session.bounds)
        with pytest.raises(LatticeError, match="not symmetric"):
            session.move(session.slice_mask("w", -1), [0, 0, 1], plane=plane)
        # Points of the model are mirrored all the same.
        assert len(session.drag([[3, 1, 2]], by=[[0, 0, 1]], plane=plane)[0]["drag"]["pairs"]) == 2
