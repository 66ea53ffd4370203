"""`ffd info LATTICE --mesh MESH` counts what Song & Yang 2005, Table 1, counts."""

import json

import numpy as np
import pytest

from ffdcli import read_mesh
from support.commands import ffd
from support.places import SAMPLES

TREE = SAMPLES / "octree" / "tree.ply"


@pytest.mark.parametrize(("depth", "regular"), [(3, 729), (4, 4913), (5, 35937)])
def test_control_points_by_octree_and_by_regular_subdivision(tmp_path, depth, regular):
    path = tmp_path / "l.yaml"
    path.write_text(f"version: 1\nvolume: tspline\noctree: {{depth: {depth}, refine: vertices}}\n")
    facts = json.loads(ffd("info", path, "--mesh", TREE, "--json").stdout)
    assert facts["control_points_if_regular"] == regular
    assert facts["control_points"] < (0.65 if depth == 3 else 0.4) * regular
    assert facts["exposed"] + facts["hidden"] == facts["control_points"]
    assert sum(facts["cells_by_level"]) == facts["cells"]
    # Cells with a vertex are the finest, and as many as places of the finest grid that hold one.
    points = read_mesh(TREE).vertices
    low, high = (np.array(facts["box"][end]) for end in ("min", "max"))
    places = np.floor((points - low) / (high - low) * 2**depth).astype(int)
    assert facts["cells_with_mesh"] == len(np.unique(places, axis=0))
    assert facts["jacobian"]["bound"] == 1.0
