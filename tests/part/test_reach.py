"""What reaches an item: nothing, one affine map, or a map that bends it."""

import numpy as np

from ffdcli.lattice import parse_lattice
from ffdcli.lattice.file.source import Source
from ffdcli.part.cover import cover_edges, cover_faces, cover_points
from ffdcli.part.outline import outlines_of
from ffdcli.part.reach import find_reached
from support.hand_parts import ball, cylinder, lattice_for
from support.lattice_models import box_triangles


def faces_of(part):
    return cover_faces(part, outlines_of(part))


def test_boxes_cover_their_items():
    rng = np.random.default_rng(0)
    for part in (cylinder(), ball()):
        cover = faces_of(part)
        for face, (surface, (low, high)) in enumerate(
            zip(part.surfaces, part.rectangles, strict=True)
        ):
            if surface.kind == "plane":
                continue
            at = low + rng.random((400, 2)) * (high - low)
            points = surface.points(*at.T)[:, None]
            boxes = cover.boxes[cover.owner == face]
            held = ((points >= boxes[:, 0]) & (points <= boxes[:, 1])).all(axis=2)
            assert held.any(axis=1).all()
        low, high = cover.bounds
        assert (low.min(axis=0) <= part.bounds[0]).all()
        assert (high.max(axis=0) <= part.bounds[1] + 0.1).all()


def test_a_face_in_a_crossed_side_stays():
    """The top lies in the lower side of the box, which the part reaches from below."""
    part = cylinder()
    box = {"min": [-3, -3, 5], "max": [3, 3, 6]}
    found = find_reached(lattice_for(part, box=box), faces_of(part), part.size)
    assert found.identity.all()
    box = {"min": [-3, -3, 0], "max": [3, 3, 6]}
    found = find_reached(lattice_for(part, box=box), faces_of(part), part.size)
    assert not found.identity.any()


def test_cells_at_rest_change_nothing():
    part = cylinder()
    lattice = lattice_for(part, amount=0.0, points=[4, 4, 12])
    net = lattice.points.copy()
    net[:, :, 9:] += [0.1, 0.2, 0.3]
    found = find_reached(lattice.with_net(net), faces_of(part), part.size)
    assert found.identity.tolist() == [False, True, False]
    assert found.affine.tolist() == [False, True, False]
    edges = find_reached(lattice.with_net(net), cover_edges(part), part.size)
    assert edges.identity.tolist() == [True, False, False]


def test_one_affine_map():
    part = ball()
    matrix, shift = np.array([[1.0, 0.2, 0], [0, 1.1, 0], [0.1, 0, 0.9]]), np.array([1.0, 2, 3])
    lattice = lattice_for(part, amount=0.0)
    moved = lattice.with_net(lattice.points @ matrix.T + shift)
    found = find_reached(moved, faces_of(part), part.size)
    assert found.affine.all()
    assert not found.identity.any()
    assert np.abs(found.matrix - matrix).max() <= 1e-13
    assert np.abs(found.offset - shift).max() <= 1e-13
    points = find_reached(moved, cover_points(part.points), part.size)
    assert points.affine.all()


def test_several_boxes_and_what_lies_between():
    part = cylinder()
    keys = {"degree": [2, 2, 2], "points": [4, 4, 5], "border": "c1"}
    boxes = [{"min": [-3, -3, low], "max": [3, 3, low + 1.5]} for low in (-0.5, 4.0)]
    data = {"version": 1, "lattices": [{**keys, "box": box} for box in boxes]}
    lattice = parse_lattice(data, Source("l.yaml")).settle(
        bounds=part.bounds, triangles=box_triangles(*part.bounds), delta=1e-9 * part.size
    )
    rng = np.random.default_rng(1)
    for number, member in enumerate(lattice.members):
        moves = 0.1 * rng.random(member.points.shape)
        net = member.points + np.where(member.locked[..., None], 0, moves)
        lattice = lattice.with_member(number, member.with_net(net))
    found = find_reached(lattice, faces_of(part), part.size)
    assert not found.affine.any()
    assert [found.map_of(face) for face in range(3)] == [None, lattice.maps[0], lattice.maps[1]]
    middle = find_reached(lattice, cover_points(np.array([[0, 0, 2.5]])), part.size)
    assert middle.identity.all()


def test_a_map_goes_on_beyond_sides_that_are_not_crossed():
    part = cylinder()
    lattice = lattice_for(part)
    found = find_reached(lattice, faces_of(part), part.size)
    inside, outside = np.array([[0.5, 1.0, 5.0]]), np.array([[0.5, 1.0, 6.0]])
    one = lattice.maps[0]
    wanted = one.evaluate(inside) + one.jacobian(inside)[:, :, 2]
    assert np.abs(found.images(outside, np.array([0])) - wanted).max() <= 1e-13
