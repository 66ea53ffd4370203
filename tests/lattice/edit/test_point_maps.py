"""Maps of points behind the edits: rotation, transform, twist, taper, bend."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from ffdcli.lattice.edit.point_maps import bend, cos_sin, rotate, taper, transform, twist

BOX = np.array([[1.0, -2.0, 0.5], [4.0, 6.0, 2.5]])
CENTRE = BOX.mean(axis=0)
points = arrays(np.float64, (7, 3), elements=st.floats(-10, 10))
axes = st.integers(0, 2)
angles = st.floats(-720, 720)


def turned(p, axis, degrees, centre):
    vector = np.deg2rad(degrees) * np.eye(3)[axis]
    return Rotation.from_rotvec(vector).apply(p - centre) + centre


@given(points, axes, angles)
def test_rotate_is_right_handed(p, axis, angle):
    np.testing.assert_allclose(
        rotate(p, axis, np.asarray(angle), CENTRE), turned(p, axis, angle, CENTRE), atol=1e-12
    )


def test_quarter_turns_are_exact():
    cosine, sine = cos_sin(np.array([0.0, 90.0, 180.0, 270.0, 360.0, -90.0]))
    assert cosine.tolist() == [1, 0, -1, 0, 1, 0]
    assert sine.tolist() == [0, 1, 0, -1, 0, -1]


@given(points, axes, angles)
def test_transform_scales_then_rotates_then_translates(p, axis, angle):
    scale, shift, centre = np.array([2.0, 0.5, -1.0]), np.array([3.0, 4.0, 5.0]), np.ones(3)
    got = transform(p, scale=scale, rotation=(axis, angle), translate=shift, centre=centre)
    scaled = (p - centre) * scale + centre
    np.testing.assert_allclose(got, turned(scaled, axis, angle, centre) + shift, atol=1e-11)


@given(points)
def test_transform_that_does_nothing_changes_no_bit(p):
    got = transform(p, scale=np.ones(3), rotation=(0, 360.0), translate=np.zeros(3), centre=CENTRE)
    assert np.array_equal(got, p)


@given(points, axes, angles)
def test_twist_turns_each_point_by_its_share(p, axis, angle):
    share = (p[:, axis] - BOX[0, axis]) / (BOX[1, axis] - BOX[0, axis])
    want = [turned(q, axis, angle * s, CENTRE) for q, s in zip(p, share, strict=True)]
    np.testing.assert_allclose(twist(p, BOX, axis, angle), want, atol=1e-11)


@given(points, axes, st.floats(0.01, 5))
def test_taper_scales_each_point_by_its_share(p, axis, factor):
    share = (p[:, axis] - BOX[0, axis]) / (BOX[1, axis] - BOX[0, axis])
    scale = np.where(np.arange(3) == axis, 1.0, 1 + (factor - 1) * share[:, None])
    want = CENTRE + (p - CENTRE) * scale
    np.testing.assert_allclose(taper(p, BOX, axis, factor), want, atol=1e-11)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("step", [1, 2])
@pytest.mark.parametrize("angle", [1e-9, 30.0, -75.0, 180.0, 400.0])
def test_bend_lays_the_centre_line_on_an_arc(axis, step, angle):
    toward = (axis + step) % 3
    length = BOX[1, axis] - BOX[0, axis]
    s = np.linspace(0, length, 2001)
    line = np.tile(CENTRE, (len(s), 1))
    line[:, axis] = BOX[0, axis] + s
    bent = bend(line, BOX, axis, toward, angle)
    assert np.array_equal(bent[0], line[0])
    chords = np.linalg.norm(np.diff(bent, axis=0), axis=1)
    assert chords.sum() == pytest.approx(length, rel=1e-5)
    np.testing.assert_allclose(chords, chords[0], rtol=1e-9)
    # The tangent at the end has turned by the angle, towards `toward`.
    tangent = bent[-1] - bent[-2]
    half_step = np.deg2rad(angle) * (1 - 0.5 / 2000)
    want = np.cos(half_step) * np.eye(3)[axis] + np.sin(half_step) * np.eye(3)[toward]
    np.testing.assert_allclose(tangent / np.linalg.norm(tangent), want, atol=1e-8)


@given(points, axes, st.integers(1, 2), st.floats(1, 300))
def test_bend_keeps_cross_sections_flat_and_perpendicular(p, axis, step, angle):
    toward = (axis + step) % 3
    third = 3 - axis - toward
    foot = p.copy()
    foot[:, [toward, third]] = CENTRE[[toward, third]]
    bent, bent_foot = bend(p, BOX, axis, toward, angle), bend(foot, BOX, axis, toward, angle)
    ahead = foot.copy()
    ahead[:, axis] += 1e-6
    tangent = (bend(ahead, BOX, axis, toward, angle) - bent_foot) / 1e-6
    arm = bent - bent_foot
    np.testing.assert_allclose(
        np.linalg.norm(arm, axis=1), np.linalg.norm(p - foot, axis=1), atol=1e-10
    )
    np.testing.assert_allclose(np.einsum("ij,ij->i", arm, tangent), 0, atol=1e-3)
    np.testing.assert_array_equal(bent[:, third], p[:, third])


@given(points, axes)
def test_edits_of_no_size_change_no_bit(p, axis):
    assert np.array_equal(twist(p, BOX, axis, 0.0), p)
    assert np.array_equal(taper(p, BOX, axis, 1.0), p)
    assert np.array_equal(bend(p, BOX, axis, (axis + 1) % 3, 0.0), p)
