"""Edges too short for STEP files: judged by the whole curve, not by its ends alone."""

from dataclasses import replace

import numpy as np
import pytest

from ffdcli.brep.occ.writing.short_edges import require_kept_edges
from ffdcli.errors import CheckError
from support.brep_models import bumpy, cube


def test_a_curve_that_comes_back_to_its_start_is_not_short():
    brep = cube(bumpy)
    edge = int(brep.curves[0].edges[0])
    start, end = brep.edges[edge]
    points = brep.points.copy()
    points[end] = points[start]
    require_kept_edges(replace(brep, points=points))
    poles = [np.array(batch.poles) for batch in brep.curves]
    poles[0][0] = poles[0][0, :1]
    shrunk = tuple(replace(b, poles=p) for b, p in zip(brep.curves, poles, strict=True))
    with pytest.raises(CheckError, match="1 edge is shorter than 1e-07"):
        require_kept_edges(replace(brep, points=points, curves=shrunk))
