"""The eight panels of Feng 2002, also for octrees and fitted volumes, and the error picture."""

from __future__ import annotations

import numpy as np
import pytest

from ffdcli import prepare
from ffdcli.cli import main
from ffdcli.view.colours import HIDDEN, POINT
from ffdcli.view.eight_panels import eight_panels
from ffdcli.view.error_map import error_panel, signed_colours
from ffdcli.view.panel import Balls, Triangles

LATTICE = """\
degree: [2, 2, 2]
points: [4, 4, 4]
edits:
  - twist: {axis: w, angle: 60}
  - taper: {axis: w, factor: 0.6}
"""


def facets(panel):
    return [part for part in panel.parts if isinstance(part, Triangles)]


def test_the_eight_panels_of_the_papers_cube(job):
    mesh, lattice = job(LATTICE)
    panels = eight_panels(prepare(mesh, lattice, patches="paper"), lattice)
    assert [panel.title[0] for panel in panels] == list("12345678")
    # Original, vertices, two subdivisions: 12, 12 and 12 * 4**2 triangles.
    assert [len(facets(panel)[0].triangles) for panel in panels[:3]] == [12, 12, 192]
    # 24 coplanar groups, drawn in as many tints as there are: 36 sub-polygons are 4 + 4 + ...
    colours = [np.unique(part.colours, axis=0) for part in facets(panels[5])]
    assert 1 < len(colours[0]) <= 8
    # All kinds of patches go exactly through the image of every corner that the cuts make.
    corners = prepare(mesh, lattice, patches="bezier").deform(lattice).brep.points
    assert len(corners) == 26
    for number in (4, 6, 7):
        drawn = np.concatenate([part.points for part in facets(panels[number])])
        away = np.linalg.norm(corners[:, None] - drawn[None], axis=2).min(axis=1)
        assert away.max() < 1e-12


OCTREE = """\
volume: tspline
octree: {depth: 2, also: [{min: [0, 0, 0], max: [0.5, 0.5, 0.5], depth: 3}]%s}
edits:
  - move: {at: {near: [0.3, 0.3, 0.3]}, by: [0.05, -0.04, 0.03]}
"""


@pytest.mark.parametrize("embedding", ["displacement", "inverse"])
def test_the_eight_panels_of_an_octree(job, embedding):
    mesh, lattice = job(OCTREE % f", embedding: {embedding}")
    plan = prepare(mesh, lattice, patches="paper", fit_tolerance=fit(embedding))
    panels = eight_panels(plan, lattice)
    fitted = [panel.title.endswith("(fitted)") for panel in panels]
    assert fitted == [False] * 3 + [embedding == "inverse"] * 5
    assert [len(facets(panel)[0].triangles) for panel in panels[:3]] == [12, 12, 192]
    # Panels 4 and 5 show the same triangles, 6 all pieces; 5, 7 and 8 go through all corners.
    corners = plan.deform(lattice, check=False).brep.points
    assert len(corners) > 100
    for number in (4, 6, 7):
        drawn = np.concatenate([part.points for part in facets(panels[number])])
        away = np.linalg.norm(corners[:, None] - drawn[None], axis=2).min(axis=1)
        assert away.max() < 1e-9
    cut = len(facets(panels[3])[0].triangles)
    assert len(facets(panels[4])[0].triangles) == cut * 6**2
    # The control points of empty cells are drawn on request only, in their own colour.
    (member,) = lattice.members
    hidden = member.map.hidden
    assert 0 < hidden.sum() < len(hidden)
    places = member.map.frame.to_model(member.map.rest_points)
    (shown,) = balls(panels[0])
    assert (shown.colour, len(shown.points)) == (POINT, (~hidden).sum())
    every = balls(eight_panels(plan, lattice, hidden_points=True)[0])
    assert [(part.colour, len(part.points)) for part in every] == [
        (POINT, (~hidden).sum()),
        (HIDDEN, hidden.sum()),
    ]
    assert np.allclose(every[1].points, places[hidden], rtol=0, atol=1e-15)


def fit(embedding):
    return 1e-2 if embedding == "inverse" else None


def balls(panel):
    return [part for part in panel.parts if isinstance(part, Balls)]


def test_compare_prints_the_table(job, tmp_path, capsys, artefacts):
    job(LATTICE)
    files = (tmp_path / "mesh.obj", tmp_path / "lattice.yaml")
    with pytest.raises(SystemExit) as end:
        main(["view", *map(str, files), "--compare", "-o", str(artefacts / "compare.png")])
    assert end.value.code == 0
    rows = {line.split()[0]: line.split()[1:4] for line in capsys.readouterr().out.splitlines()}
    assert rows["bezier"] == ["36", "24", "216"]
    assert rows["merged"][1] == "6"


def test_compare_says_that_the_volume_is_fitted(job, tmp_path, capsys, artefacts):
    job(OCTREE % ", embedding: inverse")
    files = (tmp_path / "mesh.obj", tmp_path / "lattice.yaml")
    out = artefacts / "compare-inverse.png"
    with pytest.raises(SystemExit) as end:
        main(["view", *map(str, files), "--compare", "-o", str(out), "--fit-tolerance", "0.01"])
    assert end.value.code == 0
    *_, said, wrote = capsys.readouterr().out.splitlines()
    assert said.startswith("of the fitted volume, at most ")
    assert 0 < float(said.split("at most ")[1].split()[0]) <= 0.01
    assert wrote == f"wrote {out}"


def test_the_error_picture_states_its_maximum(job):
    mesh, lattice = job(LATTICE)
    coarse = error_panel(mesh, lattice, "vertices")
    assert coarse.scale is not None
    fine = error_panel(mesh, lattice, "uniform", tolerance=0.02)
    assert fine.scale is not None
    assert 0 < fine.scale.high < coarse.scale.high
    assert -fine.scale.low == fine.scale.high
    assert f"{fine.scale.high:.3g}" in fine.title


def test_signed_colours_tell_sides_apart():
    below, none, above = signed_colours(np.array([-1.0, 0.0, 1.0]))
    assert below[2] > below[0]
    assert above[0] > above[2]
    assert none.min() > 0.9
