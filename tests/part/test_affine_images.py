"""Images under affine maps have the points of the map at the same parameters."""

import numpy as np
import pytest

from ffdcli.part.affine_images import AffineMap, affine_curve, affine_surface, line_as_spline
from ffdcli.part.curves import Line
from support.geom_models import geom_curves, geom_surfaces

SQUARE = np.array([[0.0, 0], [1, 1]])


def maps(seed):
    """A motion, a mirror image of another size, and a map with shear."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    shift = rng.normal(size=3)
    mirror = turn @ np.diag([1.0, 1, -1])
    return {
        "motion": AffineMap(turn, shift),
        "mirror": AffineMap(1.7 * mirror, shift),
        "shear": AffineMap(turn + 0.3 * rng.random((3, 3)), shift),
    }


CURVES = {
    "motion": {"line", "circle", "ellipse", "hyperbola", "parabola", "b-spline", "rational",
               "offset"},
    "mirror": {"circle", "ellipse", "b-spline", "rational", "offset"},
    "shear": {"b-spline", "rational"},
}  # fmt: skip
SURFACES = {
    "motion": {"cylinder", "cone", "sphere", "torus", "b-spline", "rational", "extrusion",
               "revolution", "offset", "offset of revolution"},
    "mirror": {"sphere", "torus", "b-spline", "rational", "extrusion", "revolution", "offset",
               "offset of revolution"},
    "shear": {"b-spline", "rational", "extrusion"},
}  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", CURVES)
def test_curves(name, seed):
    by = maps(seed)[name]
    at = np.linspace(0, 1, 30)
    exact = set()
    for kind, (curve, _) in geom_curves(np.random.default_rng(seed)).items():
        image = affine_curve(curve, by)
        if image is not None:
            exact.add(kind)
            assert np.abs(image.points(at) - by.points(curve.points(at))).max() <= 1e-12, kind
    assert exact == CURVES[name]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", SURFACES)
def test_surfaces(name, seed):
    by = maps(seed)[name]
    u, v = np.random.default_rng(9).random((2, 40))
    exact = set()
    for kind, (surface, _) in geom_surfaces(np.random.default_rng(seed)).items():
        image = affine_surface(surface, SQUARE, by)
        wanted = by.points(surface.points(u, v))
        if kind == "plane":
            assert np.abs((wanted - image.origin) @ image.z).max() <= 1e-12
            frame = np.stack([image.x, image.y, image.z])
            assert np.abs(frame @ frame.T - np.eye(3)).max() <= 1e-14
        elif image is not None:
            exact.add(kind)
            assert np.abs(image.points(u, v) - wanted).max() <= 1e-11, kind
    assert exact == SURFACES[name]


def test_a_line_as_a_spline_keeps_its_parameter():
    line = Line(np.array([1.0, 2, 3]), np.array([0.5, -1, 2]))
    spline = line_as_spline(line, -2.0, 7.0)
    at = np.linspace(-2, 7, 20)
    assert np.abs(spline.points(at) - line.points(at)).max() <= 1e-14 * 20
