"""Comparison of a CAD file with the deformation: good files pass, faulty ones fail."""

from dataclasses import replace

import numpy as np
import pytest

from ffdcli.brep.evaluate.lookup import model_of_brep
from ffdcli.deformation import Breaks
from ffdcli.verify import verify
from support.brep_models import (
    bumpy,
    cube,
    cube_with_cavity,
    flip_face,
    plate_with_hole,
    turn_inside_out,
    without_last_face,
)
from support.verify_models import (
    BOX_TRIANGLES,
    Bent,
    facets,
    gentle,
    kinked,
    kinked_cube,
    sphere,
    triangle_mesh,
)

BREAKS = Breaks(np.zeros(3), np.eye(3), (np.array([0.0, 0.5, 1.0]),) * 3)
CORNERS = cube().points


def judge(brep, mapping, points=CORNERS, triangles=BOX_TRIANGLES, **options):
    mesh = triangle_mesh(points, triangles)
    options = {"kernel_valid": True, "tolerance": 1e-6 * mesh.size, "samples": 500} | options
    verdict = verify(
        model_of_brep(brep).read,
        mesh=mesh,
        deformation=Bent(mapping, (BREAKS,)),
        **options,
    )
    assert verdict.passed == (verdict.reasons == ())
    return verdict


def same(points):
    return points


def boxes(*parts):
    """Points and triangles of unit boxes scaled and moved, and turned inwards where asked."""
    points = [CORNERS * size + shift for size, shift, _ in parts]
    triangles = [
        (BOX_TRIANGLES[:, ::-1] if inwards else BOX_TRIANGLES) + 8 * i
        for i, (_, _, inwards) in enumerate(parts)
    ]
    return np.concatenate(points), np.concatenate(triangles)


CAVITY = boxes((1, 0, False), (0.5, 0.25, True))


@pytest.mark.parametrize(
    ("brep", "mapping", "mesh", "faces"),
    [
        (cube(), same, (CORNERS, BOX_TRIANGLES), 6),
        (cube(bumpy), bumpy, (CORNERS, BOX_TRIANGLES), 6),
        (kinked_cube(), kinked, (CORNERS, BOX_TRIANGLES), 6),
        (cube_with_cavity(bumpy), bumpy, CAVITY, 12),
        (facets(*sphere(2), gentle, 6), gentle, sphere(2), 320),
    ],
)
def test_good_files_pass_to_rounding(brep, mapping, mesh, faces):
    verdict = judge(brep, mapping, *mesh)
    assert verdict.reasons == ()
    size = triangle_mesh(*mesh).size
    assert verdict.max_deviation < 5e-13 * size
    assert verdict.rms_deviation <= verdict.max_deviation
    assert verdict.volume == pytest.approx(verdict.expected_volume, rel=1e-12)
    assert (verdict.valid, verdict.watertight) == (True, True)
    assert (verdict.solids, verdict.faces, verdict.unit) == (1, faces, "mm")
    assert verdict.samples > 1000


def test_far_from_the_origin_and_tiny():
    for scale, shift in ((1e-4, 0.0), (10.0, 1e6)):

        def moved(points, scale=scale, shift=shift):
            return bumpy((points - shift) / scale) * scale + shift

        points = CORNERS * scale + shift
        plain = cube(bumpy)
        brep = replace(
            plain,
            points=plain.points * scale + shift,
            curves=(replace(plain.curves[0], poles=plain.curves[0].poles * scale + shift),),
            surfaces=(replace(plain.surfaces[0], poles=plain.surfaces[0].poles * scale + shift),),
        )
        verdict = judge(brep, moved, points)
        assert verdict.reasons == ()
        assert verdict.max_deviation < 1e-12 * scale + 1e-14 * shift


def test_the_same_call_gives_the_same_verdict():
    assert judge(cube(bumpy), bumpy) == judge(cube(bumpy), bumpy)


def test_a_mirroring_deformation_has_positive_volume():
    def mirror(points):
        return bumpy(points) * np.array([-1.0, 1.0, 1.0])

    verdict = judge(turn_inside_out(cube(mirror)), mirror)
    assert verdict.reasons == ()
    assert verdict.expected_volume > 0


def test_an_open_mesh_and_an_open_shell():
    brep = without_last_face(cube(bumpy))
    brep = replace(brep, shell_closed=np.array([False]), shell_solid=np.array([-1]))
    verdict = judge(brep, bumpy, triangles=BOX_TRIANGLES[:-2])
    assert verdict.reasons == ()
    assert (verdict.watertight, verdict.solids, verdict.volume) == (False, 0, None)


def test_the_kernels_word_counts():
    verdict = judge(cube(bumpy), bumpy, kernel_valid=False)
    assert not verdict.valid
    assert verdict.reasons == ("OpenCascade does not find the file's shape valid",)


def test_another_mesh():
    points = CORNERS.copy()
    points[7] += 0.001
    verdict = judge(cube(bumpy), bumpy, points)
    assert "points of the deformed mesh are not on the file's faces" in verdict.reasons[0]
    assert any("faces of the file are not on the deformed mesh" in r for r in verdict.reasons)
    assert 1e-4 < verdict.max_deviation < 1e-2


def test_another_lattice():
    def other(points):
        x, y, z = np.moveaxis(bumpy(points), -1, 0)
        return np.stack([x, y, z + 1e-4 * points[..., 0] * points[..., 1]], axis=-1)

    verdict = judge(cube(bumpy), other)
    assert not verdict.passed
    assert 1e-5 < verdict.max_deviation <= 1.0001e-4


def test_a_mesh_that_has_more():
    verdict = judge(cube(bumpy), bumpy, *boxes((1, 0, False), (0.1, 3, False)))
    assert any("holds 1 solids, but the mesh has 2 bodies" in r for r in verdict.reasons)
    assert any("points of the deformed mesh are not" in r for r in verdict.reasons)


def test_a_file_that_has_more():
    verdict = judge(cube_with_cavity(bumpy), bumpy)
    assert any("6 faces of the file are not on the deformed mesh" in r for r in verdict.reasons)
    assert any("volume is" in r for r in verdict.reasons)


def test_a_missing_face():
    verdict = judge(without_last_face(cube(bumpy)), bumpy)
    assert not verdict.watertight
    assert "4 edges belong to one face only: a face is missing" in verdict.reasons[0]
    assert any("points of the deformed mesh are not on the file" in r for r in verdict.reasons)


@pytest.mark.parametrize("face", range(6))
def test_a_flipped_face(face):
    verdict = judge(flip_face(cube(bumpy), face), bumpy)
    assert not verdict.watertight
    assert "4 edges are used twice in one sense" in verdict.reasons[0]
    assert any(f"faces look inwards, the first face {face + 1} " in r for r in verdict.reasons)
    assert verdict.max_deviation < 1e-12


def test_a_solid_inside_out():
    verdict = judge(turn_inside_out(cube(bumpy)), bumpy)
    assert verdict.watertight
    assert any("solid 1 is inside out" in r for r in verdict.reasons)
    assert any("6 faces look inwards" in r for r in verdict.reasons)
    assert any("volume is" in r for r in verdict.reasons)


def raised(brep, face, i, j, height):
    """Move one pole along its face's normal, so that the face moves by ``height`` at most."""
    surfaces = brep.surfaces[0]
    net = surfaces.poles[face]
    normal = np.cross(net[-1, 0] - net[0, 0], net[0, -1] - net[0, 0])
    lift = np.zeros_like(surfaces.poles)
    lift[face, i, j] = normal / np.linalg.norm(normal)
    model = model_of_brep(replace(brep, surfaces=(replace(surfaces, poles=lift),)))
    low, high = model.domain[face]
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 60), np.linspace(0, 1, 60)), axis=-1)
    uv = low + grid.reshape(-1, 2) * (high - low)
    moved, _ = model.on_faces(np.full(len(uv), face), uv)
    poles = surfaces.poles + lift * height / np.linalg.norm(moved, axis=1).max()
    return replace(brep, surfaces=(replace(surfaces, poles=poles),))


@pytest.mark.parametrize(("i", "j"), [(i, j) for i in range(5) for j in range(i % 2, 5, 2)])
def test_any_pole_moved_so_that_its_face_moves_by_a_hundred_thousandth(i, j):
    brep = kinked_cube()
    face = (i + 2 * j) % 6
    size = np.sqrt(3)
    verdict = judge(raised(brep, face, i, j, 1e-5 * size), kinked, samples=100)
    assert not verdict.passed
    assert 2e-6 * size < verdict.max_deviation < 1.2e-5 * size
    on_border = i in (0, 4) or j in (0, 4)
    named = f"worst face {face + 1} at"
    assert on_border or any(named in reason for reason in verdict.reasons)


def test_a_pole_moved_by_less_than_the_tolerance():
    verdict = judge(raised(kinked_cube(), 2, 2, 2, 1e-8), kinked)
    assert verdict.passed
    assert 1e-9 < verdict.max_deviation < 1.2e-8


def test_a_pole_of_one_facet_among_many():
    points, triangles = sphere(2)
    brep = facets(points, triangles, gentle)
    size = triangle_mesh(points, triangles).size
    verdict = judge(raised(brep, 123, 1, 2, 1e-5 * size), gentle, points, triangles)
    assert not verdict.passed
    assert any("1 faces of the file" in r and "worst face 124 " in r for r in verdict.reasons)


def test_an_edge_off_its_faces():
    brep = cube(bumpy)
    poles = brep.curves[0].poles.copy()
    poles[3, 1, 2] += 1e-4
    verdict = judge(replace(brep, curves=(replace(brep.curves[0], poles=poles),)), bumpy)
    assert any(r.startswith("edge 4 near") for r in verdict.reasons)


def test_thin_walls_are_told_apart():
    """Two sheets far closer together than the points spread over them."""

    def thin(points):
        return bumpy(points * np.array([1, 1, 1e-3]))

    verdict = judge(cube(thin), thin)
    assert verdict.reasons == ()
    assert verdict.max_deviation < 1e-12


def test_needles_are_found():
    """Fans of needles, a thousand times as long as wide, meeting in one corner of each side."""
    count = 150
    ring = np.stack([np.full(count, 1.0), np.linspace(0, 0.3, count), np.zeros(count)], axis=1)
    points = np.concatenate([[[0.0, 0, 0]], ring, [[0.0, 0, -0.4]]])
    last = count + 1
    triangles = [(0, i, i + 1) for i in range(1, count)] + [
        (last, i + 1, i) for i in range(1, count)
    ]
    triangles = np.array([*triangles, (0, count, last), (0, last, 1)])
    points = points @ np.array([[0.9, 0.3, 0.1], [-0.2, 0.9, 0.3], [0.1, -0.3, 0.9]])
    verdict = judge(facets(points, triangles, gentle), gentle, points, triangles)
    assert verdict.reasons == ()
    assert verdict.max_deviation < 1e-12


def test_nothing_in_the_file():
    brep = cube(bumpy)
    empty = replace(
        model_of_brep(brep).read,
        surfaces=(),
        face_surface=np.zeros(0, int),
        face_reversed=np.zeros(0, bool),
        face_loops=np.zeros(1, int),
        loop_coedges=np.zeros(1, int),
        coedge_edge=np.zeros(0, int),
        coedge_forward=np.zeros(0, bool),
        pcurves=(),
        face_shell=np.zeros(0, int),
        shell_closed=np.zeros(0, bool),
        shell_solid=np.zeros(0, int),
        face_tolerance=np.zeros(0),
    )
    mesh = triangle_mesh(CORNERS, BOX_TRIANGLES)
    verdict = verify(empty, True, mesh, Bent(bumpy, (BREAKS,)), 1e-6)
    assert not verdict.passed
    assert verdict.reasons[0] == "the file holds no faces"
    assert (verdict.faces, verdict.solids, verdict.max_deviation) == (0, 0, np.inf)


def test_holes_and_what_is_around_them():
    """A plate with a hole, as triangles: the two sides with the hole as eight each."""
    brep = plate_with_hole(gentle)
    points = plate_with_hole().points
    ring = [(0, 4), (4, 6), (6, 2), (2, 0)]
    triangles = []
    for side, turn in ((0, -1), (1, 1)):
        for a, b in ring:
            quad = [a + side, b + side, b + side + 8, a + side + 8]
            for three in (quad[:3], [quad[0], *quad[2:]]):
                triangles.append(three[::turn])
    walls = BOX_TRIANGLES[:8]
    triangles = np.concatenate([triangles, walls, walls[:, ::-1] + 8])
    verdict = judge(brep, gentle, points, triangles)
    assert verdict.reasons == ()
    assert verdict.max_deviation < 1e-12
