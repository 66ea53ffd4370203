"""Drawn triangles: those of the model, divided where faces are large, coloured face by face."""

import numpy as np
import pytest

from ffdcli.editor import Session
from ffdcli.editor import drawn as drawing
from ffdcli.editor.drawn import MOST_VERTICES, draw_model, flat_faces
from ffdcli.mesh import triangles
from support.editor_models import CORNERS, KINDS, QUADS, session_of
from support.mesh_models import make
from support.parts import write_part


def area(points, corners):
    sides = points[corners[:, 1:]] - points[corners[:, :1]]
    return np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum() / 2


def test_a_box_is_six_faces_of_small_triangles():
    mesh = make(CORNERS, QUADS)
    drawn = draw_model(mesh, mesh)
    assert len(np.unique(drawn.face)) == 6
    assert np.isclose(area(drawn.rest, drawn.triangles), 2 * (4 * 3 + 3 * 2 + 4 * 2))
    ends = drawn.rest[drawn.triangles]
    assert (
        np.linalg.norm(ends - np.roll(ends, 1, axis=1), axis=2).max()
        <= 2 * drawing.EDGE * mesh.size
    )
    assert len(drawn.rest) < 1.5 * MOST_VERTICES
    # Faces have one colour, and neighbours another.
    colours = {}
    for face in range(6):
        (colour,) = np.unique(
            drawn.colours[drawn.triangles[drawn.face == face]].reshape(-1, 3), axis=0
        )
        normal = np.ptp(drawn.rest[drawn.triangles[drawn.face == face]].reshape(-1, 3), axis=0)
        colours.setdefault(tuple(colour), []).append(int(np.argmin(normal)))
    assert all(len(set(axes)) == 1 for axes in colours.values())
    # Twelve edges, each in pieces.
    length = np.linalg.norm(np.diff(drawn.rest[drawn.outline], axis=1)[:, 0], axis=1).sum()
    assert np.isclose(length, 4 * (4 + 3 + 2))


def test_coplanar_triangles_are_one_face_and_others_are_not():
    mesh = make(CORNERS, QUADS)
    corners, polygon = triangles(mesh)
    found = flat_faces(mesh.vertices, corners)
    assert len({(a, b) for a, b in zip(found, polygon, strict=True)}) == 6
    bent = mesh.vertices.copy()
    bent[6, 2] += 1e-3
    assert len(np.unique(flat_faces(bent, corners))) == 7


def test_a_model_of_very_many_faces_is_drawn_as_it_is(monkeypatch):
    monkeypatch.setattr("ffdcli.editor.drawn.MOST_COLOURED", 5)
    monkeypatch.setattr("ffdcli.editor.drawn.MOST_VERTICES", 8)
    mesh = make(CORNERS, QUADS)
    drawn = draw_model(mesh, mesh)
    assert len(drawn.rest) == 8
    assert len(np.unique(drawn.colours, axis=0)) == 1


@pytest.mark.parametrize("kind", ["bspline", "nurbs", "hierarchical"])
def test_exact_faces_are_those_of_the_deformation(tmp_path, kind):
    with session_of(tmp_path, KINDS[kind]) as session:
        for _ in range(2):
            session.append(*session.drag([[3, 1.5, 2]], by=[[0.1, 0, 0.4]]))
            stages = []
            exact = session.exact(stages.append)
            assert stages
            assert len(np.unique(exact.face)) == 6
            assert np.abs(session.image(exact.rest) - exact.vertices).max() < 1e-9 * session.size
            assert len(exact.outline)
            assert exact.colours.shape == exact.rest.shape


def test_a_cad_part_is_edited_as_a_mesh_is(tmp_path):
    part = write_part("nut", tmp_path)
    with Session.open(part) as session:
        drawn = session.drawn
        assert len(np.unique(drawn.face)) == session.model.face_count
        assert session.output != part
        top = drawn.rest[np.argmax(drawn.rest[:, 2])]
        edits = session.drag([top], by=[session.neat([0, 0, 0.1 * session.size])])
        seen = session.preview(*edits)
        session.append(*edits)
        assert np.abs(seen.vertices - session.vertices).max() <= 1e-12 * session.size
        wanted = session.image(drawn.rest)
        assert np.abs(session.vertices - wanted).max() <= 1e-12 * session.size
        exact = session.exact()
        assert len(np.unique(exact.face)) == session.model.face_count
        assert session.folds.verdict == "yes"
        session.save()
        assert session.path == tmp_path / f"{part.stem}.yaml"
