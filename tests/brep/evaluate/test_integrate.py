"""Volumes of B-reps and of deformed meshes, against exact integrals."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from ffdcli.brep.evaluate import quadrature
from ffdcli.brep.evaluate.integrate import (
    centre_of,
    mass_properties,
    shell_volumes,
    volume_of_brep,
)
from ffdcli.brep.evaluate.lookup import model_of_brep
from ffdcli.brep.evaluate.trim import outlines
from ffdcli.brep.labels import doubtful_masses
from ffdcli.deformation import Breaks
from ffdcli.verify.deformed_mesh import DeformedMesh
from ffdcli.verify.flux import fluxes
from support.brep_models import (
    bumpy,
    cube,
    cube_with_cavity,
    grid_of_cubes,
    plate_with_hole,
    split_cube,
)
from support.verify_models import (
    BOX_TRIANGLES,
    Bent,
    derivative,
    facets,
    gentle,
    kinked,
    kinked_cube,
    sphere,
)


def volume_under(mapping, low, high, breaks=(0.0, 0.5, 1.0)):
    """Integrate det J over a box, cell by cell: exact for the maps used here."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    axes = []
    for a, b in zip(low, high, strict=True):
        cuts = sorted({a, b, *(t for t in breaks if a < t < b)})
        pairs = list(pairwise(cuts))
        at = np.concatenate([(p + q) / 2 + (q - p) / 2 * nodes for p, q in pairs])
        axes.append((at, np.concatenate([(q - p) / 2 * weights for p, q in pairs])))
    grid = np.stack(np.meshgrid(*(at for at, _ in axes), indexing="ij"), axis=-1).reshape(-1, 3)
    weight = np.einsum("i,j,k->ijk", *(w for _, w in axes)).ravel()
    return float(np.linalg.det(derivative(mapping)(grid)) @ weight)


@pytest.mark.parametrize(
    ("make", "volume"), [(cube, 1), (cube_with_cavity, 7 / 8), (plate_with_hole, 3 / 16)]
)
def test_flat_bodies(make, volume):
    _, solids = volume_of_brep(make())
    assert solids == pytest.approx([volume], rel=1e-14)


def test_mapped_bodies_have_the_volume_that_the_map_gives_them():
    outer, hollow = (
        volume_under(bumpy, (0,) * 3, (1,) * 3),
        volume_under(bumpy, (0.25,) * 3, (0.75,) * 3),
    )
    shells, solids = volume_of_brep(cube_with_cavity(bumpy))
    assert shells == pytest.approx([outer, -hollow], rel=1e-13)
    assert solids == pytest.approx([outer - hollow], rel=1e-13)
    drilled = volume_under(bumpy, (0,) * 3, (1, 1, 0.25)) - volume_under(
        bumpy, (0.25, 0.25, 0), (0.75, 0.75, 0.25)
    )
    assert volume_of_brep(plate_with_hole(bumpy))[1] == pytest.approx([drilled], rel=1e-13)
    assert volume_of_brep(split_cube(bumpy))[1] == pytest.approx([outer], rel=1e-13)


def test_surfaces_with_knots_are_integrated_piece_by_piece():
    expected = volume_under(kinked, (0,) * 3, (1,) * 3)
    assert volume_of_brep(kinked_cube())[1] == pytest.approx([expected], rel=1e-13)


def test_rational_body():
    def project(points):
        """Homogeneous: a projective map, under which planes stay planes."""
        weight = 1 + 0.3 * points[..., :1] + 0.2 * points[..., 1:2]
        return np.concatenate([points, weight], axis=-1)

    def plain(points):
        image = project(points)
        return image[..., :3] / image[..., 3:]

    # det J of x / (1 + a·x) is (1 + a·x)^-4; Gauss with eight points is good to 1e-12 here.
    expected = volume_under(plain, (0,) * 3, (1,) * 3, breaks=(0.25, 0.5, 0.75))
    assert volume_of_brep(cube(project))[1] == pytest.approx([expected], rel=1e-12)


def test_many_bodies_each_get_their_volume():
    _, solids = volume_of_brep(grid_of_cubes(5))
    assert solids == pytest.approx(np.full(5, 1 / 1000), rel=1e-12)


def test_facets_enclose_what_the_deformed_mesh_does():
    points, triangles = sphere(2)
    image = DeformedMesh(points[triangles], np.full((len(triangles), 3), -1), Bent(gentle))
    expected = fluxes(image, np.zeros(3))[0].sum()
    for degree in (3, 6):
        _, solids = volume_of_brep(facets(points, triangles, gentle, degree))
        assert solids == pytest.approx([expected], rel=1e-13)


def test_mesh_integral_is_cut_at_the_breaks():
    corners = cube().points[BOX_TRIANGLES]
    whole = DeformedMesh(corners, np.full((12, 3), -1), Bent(kinked))
    expected = volume_under(kinked, (0,) * 3, (1,) * 3)
    breaks = Breaks(np.zeros(3), np.eye(3), (np.array([0, 0.5, 1]),) * 3)
    cut = replace(whole, deformation=Bent(kinked, (breaks,)))
    for centre in (np.zeros(3), np.full(3, 0.5)):
        assert fluxes(cut, centre)[0].sum() == pytest.approx(expected, rel=1e-13)
    assert fluxes(whole, np.zeros(3))[0].sum() != pytest.approx(expected, rel=1e-9)


def test_breaks_in_a_turned_frame():
    angle = 0.7
    axes = np.array(
        [[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]]
    )
    origin = np.array([0.2, -0.1, 0.3])

    def turned(points):
        return kinked((points - origin) @ axes.T) @ axes + origin

    corners = (cube().points @ axes + origin)[BOX_TRIANGLES]
    cut = Breaks(origin, axes, (np.array([0.5]),) * 3)
    nobody = np.full((12, 3), -1)
    image = DeformedMesh(corners, nobody, Bent(turned, (cut,)))
    expected = volume_under(kinked, (0,) * 3, (1,) * 3)
    assert fluxes(image, origin)[0].sum() == pytest.approx(expected, rel=1e-12)


def masses(brep):
    model = model_of_brep(brep)
    return mass_properties(model, outlines(model), centre_of(model))


def test_mass_properties_of_flat_bodies():
    (box,) = masses(cube())[2]
    assert (box.volume, box.area) == pytest.approx((1, 6), rel=1e-13)
    assert box.centroid == pytest.approx((0.5,) * 3, rel=1e-13)
    _, _, (hollow,) = masses(cube_with_cavity())
    assert (hollow.volume, hollow.area) == pytest.approx((7 / 8, 6 + 6 / 4), rel=1e-13)
    assert [mass.centroid[0] for mass in masses(grid_of_cubes(5))[2]] == pytest.approx(
        [(i + 0.25) / 5 for i in range(5)], rel=1e-12
    )
    far = cube(lambda points: points * [2.0, 3.0, 4.0] + [100, 0, -50])
    (moved,) = masses(far)[2]
    assert (moved.volume, moved.area) == pytest.approx((24, 52), rel=1e-12)
    assert moved.centroid == pytest.approx((101, 1.5, -48), rel=1e-12)


def test_mass_properties_of_mapped_bodies():
    """The map's own integrals: x det J over the box, and its tangents over the sides."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    nodes, weights = (nodes + 1) / 2, weights / 2
    solid = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    share = np.einsum("i,j,k->ijk", weights, weights, weights).ravel()
    amount = np.linalg.det(derivative(bumpy)(solid)) * share
    centroid = bumpy(solid).T @ amount / amount.sum()
    area = 0.0
    flat = np.stack(np.meshgrid(nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 2)
    for axis in range(3):
        for side in (0.0, 1.0):
            points = np.insert(flat, axis, side, axis=1)
            tangents = np.delete(derivative(bumpy)(points), axis, axis=2)
            normal = np.cross(tangents[..., 0], tangents[..., 1])
            area += np.linalg.norm(normal, axis=1) @ np.outer(weights, weights).ravel()
    shells, solids, (found,) = masses(cube(bumpy))
    assert (shells[0], solids[0]) == (found.volume, found.volume)
    assert found.volume == pytest.approx(amount.sum(), rel=1e-12)
    assert found.area == pytest.approx(area, rel=1e-9)
    assert found.centroid == pytest.approx(tuple(centroid), rel=1e-9)


def frustum(long):
    """A projective map, homogeneous: the unit cube becomes a frustum with squares of two sizes."""

    def mapping(points):
        weight = 1 / long + (1 - 1 / long) * points[..., :1]
        return np.concatenate([points, weight], axis=-1)

    return mapping


@pytest.mark.parametrize("long", [10, 100, 1000])
def test_mass_properties_of_faces_with_very_different_weights(long):
    """Squares of sides ``long`` and 1 at distance 1 with one corner above the other."""
    volume = (long**2 + long + 1) / 3
    area = long**2 + 1 + (long + 1) * (1 + np.sqrt(1 + (long - 1) ** 2))
    centroid = (
        (long**2 + 2 * long + 3) / (12 * volume),
        *[(long**4 - 1) / (long - 1) / (8 * volume)] * 2,
    )
    body = cube(frustum(long))
    model = model_of_brep(body)
    shells, _, errors = shell_volumes(model, outlines(model), centre_of(model))
    assert shells == pytest.approx([volume], rel=1e-11)
    assert abs(shells[0] - volume) <= errors[0] + 1e-12 * volume
    (mass,) = masses(body)[2]
    assert (mass.volume, mass.area) == pytest.approx((volume, area), rel=1e-11)
    assert mass.centroid == pytest.approx(centroid, rel=1e-10)
    assert max(mass.volume_error / volume, mass.area_error / area) < 1e-9
    assert doubtful_masses([mass]) == []


def test_errors_cover_what_little_effort_leaves(monkeypatch):
    monkeypatch.setattr(quadrature, "MOST_POINTS", 20_000)
    (mass,) = masses(cube(frustum(100)))[2]
    off = abs(mass.volume - (100**2 + 101) / 3)
    assert 0 < off <= mass.volume_error
    (sentence,) = doubtful_masses([mass])
    assert f"volume within {mass.volume_error:.1e}" in sentence


def test_mesh_integral_of_a_quotient_is_divided_until_rules_agree():
    def plain(points):
        image = frustum(100)(points)
        return image[..., :3] / image[..., 3:]

    corners = cube().points[BOX_TRIANGLES]
    bent = Bent(plain, rational=True)
    found, errors = fluxes(DeformedMesh(corners, np.full((12, 3), -1), bent), np.zeros(3))
    assert found.sum() == pytest.approx((100**2 + 101) / 3, rel=1e-11)
    assert errors.sum() < 1e-9 * found.sum()
