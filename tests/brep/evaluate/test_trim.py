"""Sample points inside trimming loops: holes, bridges, and curved edges."""

from dataclasses import replace

import numpy as np

from ffdcli.brep.evaluate.lookup import model_of_brep
from ffdcli.brep.evaluate.trim import areas, expand, inside, outlines, passes, spread
from support.brep_models import bridged_plate, bumpy, cube, plate_with_hole
from support.verify_models import facets, gentle, sphere


def test_areas_have_the_sign_of_the_faces_sense():
    brep = plate_with_hole(bumpy)
    area = areas(outlines(model_of_brep(brep)))
    assert np.array_equal(area < 0, brep.face_reversed)
    assert np.allclose(np.sort(np.abs(area))[-2:], 0.75, atol=1e-15)


def test_a_hole_is_outside():
    lines = outlines(model_of_brep(plate_with_hole(bumpy)))
    uv = np.array([[0.5, 0.5], [0.1, 0.5], [0.5, 0.9], [1.1, 0.5], [-0.1, 0.1]])
    assert inside(lines, np.full(5, 5), uv).tolist() == [False, True, True, False, False]


def test_a_bridge_to_the_hole_changes_nothing():
    lines = outlines(model_of_brep(bridged_plate(bumpy)))
    uv = np.array([[0.5, 0.5], [0.1, 0.51], [0.51, 0.9], [0.1, 0.1]])
    assert inside(lines, np.full(4, 5), uv).tolist() == [False, True, True, True]


def test_every_facet_gets_points_and_all_lie_inside():
    model = model_of_brep(facets(*sphere(2), gentle))
    lines = outlines(model)
    face, uv = spread(lines, np.full(model.read.face_count, 3))
    assert np.bincount(face).min() >= 9
    assert inside(lines, face, uv).all()


def test_straight_pcurves_stay_one_segment_and_curved_ones_are_followed():
    flat = outlines(model_of_brep(cube()))
    assert len(flat.ends) == 24

    def bulge(points):
        x, y, z = np.moveaxis(points, -1, 0)
        return np.stack([x + 0.4 * y * (1 - y), y, z], axis=-1)

    # The top and bottom are planes all the same; their pcurves are then the curved edges.
    curved = plane_ends(cube(bulge))
    area = areas(outlines(model_of_brep(curved)))
    assert np.isclose(abs(area[4]), 1.0, atol=1e-4)
    assert len(outlines(model_of_brep(curved)).ends) > 24


def plane_ends(brep):
    """Put the two z faces of the cube's record on planes."""
    from dataclasses import replace

    from ffdcli.brep.record import Planes

    axes = np.eye(3)
    planes = Planes(np.array([4, 5]), axes[[2, 2]] * [[0], [1]], axes[[0, 0]], axes[[1, 1]])
    batch = brep.surfaces[0]
    first = replace(
        batch,
        surfaces=batch.surfaces[:4],
        u_knots=batch.u_knots[:4],
        v_knots=batch.v_knots[:4],
        poles=batch.poles[:4],
    )
    return replace(brep, surfaces=(first,), planes=planes)


def test_ragged_helpers():
    owner, place = expand(np.array([2, 0, 3]))
    assert owner.tolist() == [0, 0, 2, 2, 2]
    assert place.tolist() == [0, 1, 0, 1, 2]
    counts = np.full(10, 3)
    slices = passes(counts, limit=7)
    assert np.concatenate([np.arange(10)[part] for part in slices]).tolist() == list(range(10))
    assert max(counts[part].sum() for part in slices) <= 9


def test_pcurves_that_miss_each_other_still_make_an_outline():
    """As of reduced results: each pcurve a little short of its vertices."""
    brep = cube(bumpy)
    short = brep.pcurves + 0.03 * (brep.pcurves.mean(axis=1, keepdims=True) - brep.pcurves)
    lines = outlines(model_of_brep(replace(brep, pcurves=short)))
    # Heights at which a ray would leave through the gap at a corner alone.
    uv = np.array([[0.5, 0.01], [0.5, 0.99], [0.5, 0.5], [1.5, 0.01], [-0.5, 0.99]])
    for face in range(6):
        assert inside(lines, np.full(5, face), uv).tolist() == [True, True, True, False, False]
