"""The check of records before they are written: each kind of fault is found."""

from dataclasses import replace

import numpy as np
import pytest

from ffdcli.verify import check_brep
from support.brep_models import (
    bridged_plate,
    bumpy,
    cube,
    cube_with_cavity,
    flip_face,
    plate_with_hole,
    split_cube,
    turn_inside_out,
    without_last_face,
)
from support.verify_models import facets, gentle, kinked_cube, sphere


@pytest.mark.parametrize("mapping", [None, bumpy])
@pytest.mark.parametrize(
    "make", [cube, cube_with_cavity, plate_with_hole, split_cube, bridged_plate]
)
def test_good_records_have_no_faults(make, mapping):
    report = check_brep(make(mapping))
    assert report.faults == ()
    assert report.watertight
    assert report.edge_gaps.max() < 1e-14
    assert report.vertex_gaps.max() < 1e-14


def test_good_splines_and_facets_have_no_faults():
    for brep in (kinked_cube(), facets(*sphere(2), gentle, 6)):
        report = check_brep(brep)
        assert report.faults == ()
        assert report.edge_gaps.max() < 1e-13


def test_a_flipped_face():
    report = check_brep(flip_face(cube(bumpy), 2))
    assert not report.watertight
    assert "4 edges are used twice in the same sense" in report.faults[0]


def test_a_face_turned_against_its_outline():
    brep = cube(bumpy)
    turned = brep.face_reversed.copy()
    turned[3] ^= True
    report = check_brep(replace(brep, face_reversed=turned))
    assert report.faults == (
        "1 faces are turned against their outlines (flipped), the first face 4 of 6",
    )


def test_a_missing_face():
    report = check_brep(without_last_face(cube(bumpy)))
    assert not report.watertight
    assert "4 edges are end of a shell that should be closed" in report.faults[0]


def test_an_open_shell_may_end():
    brep = without_last_face(cube(bumpy))
    report = check_brep(replace(brep, shell_closed=np.array([False]), shell_solid=np.array([-1])))
    assert report.faults == ()
    assert not report.watertight


def test_inside_out():
    report = check_brep(turn_inside_out(cube(bumpy)))
    assert report.watertight
    assert len(report.faults) == 1
    assert "solid 1 is inside out" in report.faults[0]


def test_a_cavity_that_faces_outwards():
    brep = cube_with_cavity()
    for face in range(6, 12):
        brep = flip_face(brep, face)
    assert check_brep(brep).faults == ("shell 2 of solid 1 faces the wrong way",)


def test_a_loop_that_is_no_chain():
    brep = cube(bumpy)
    swapped = np.arange(24)
    swapped[[8, 9]] = 9, 8
    report = check_brep(
        replace(
            brep,
            coedge_edge=brep.coedge_edge[swapped],
            coedge_forward=brep.coedge_forward[swapped],
            pcurves=brep.pcurves[swapped],
        )
    )
    assert report.faults == ("1 loops are not closed chains, the first on face 3",)


def test_a_curve_that_leaves_its_faces():
    brep = cube(bumpy)
    poles = brep.curves[0].poles.copy()
    poles[4, 1] += 1e-5
    report = check_brep(replace(brep, curves=(replace(brep.curves[0], poles=poles),)))
    assert len(report.faults) == 1
    assert "1 edges leave their faces by more than their tolerance" in report.faults[0]
    assert 2e-6 < report.edge_gaps[4] < 2e-5
    assert np.delete(report.edge_gaps, 4).max() < 1e-14


def test_a_vertex_off_its_edges():
    brep = cube(bumpy)
    points = brep.points.copy()
    points[6] += 1e-6
    report = check_brep(replace(brep, points=points))
    assert "3 edge ends miss their vertices" in report.faults[0]
    wide = replace(brep, points=points, vertex_tolerance=np.full(8, 2e-6))
    assert check_brep(wide).faults == ()
