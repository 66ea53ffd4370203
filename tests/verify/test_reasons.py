"""Messages of verification: faces that look inwards, beside sheets that lie on one another."""

import numpy as np
import pytest

from ffdcli.brep.evaluate.face_points import FacePoints
from ffdcli.brep.evaluate.nearest import Feet
from ffdcli.deformation import Deformation
from ffdcli.verify.deformed_mesh import DeformedMesh
from ffdcli.verify.reasons import looking_inwards

UP = [[0.0, 0, 0], [4, 0, 0], [0, 4, 0]]
DOWN = [[-1.0, -1, 0], [-1, 6, 0], [6, -1, 0]]
FAR = [[0.0, 0, 9], [4, 0, 9], [0, 4, 9]]


@pytest.mark.parametrize(("sheets", "messages"), [((DOWN, UP), 0), ((DOWN, FAR), 1), ((DOWN,), 1)])
def test_a_face_looks_inwards_where_no_sheet_at_its_place_looks_as_it_does(sheets, messages):
    image = DeformedMesh(np.array(sheets), np.full((len(sheets), 3), -1), Deformation.identity())
    at = np.array([[1.0, 1, 0], [0.5, 2, 0], [2, 0.5, 0]])
    spots = FacePoints(np.zeros(3, dtype=int), at[:, :2], at, np.tile([0.0, 0, 1], (3, 1)))
    # The nearest triangle that was found is the sheet that looks down.
    feet = Feet(np.zeros(3), np.zeros(3, dtype=int), np.full((3, 2), 0.3), np.zeros(3))
    found = looking_inwards(
        image, feet, spots, 1e-6, np.ones(len(sheets)), np.ones(1, dtype=bool), 1e-12
    )
    assert len(found) == messages
    assert all("1 faces look inwards, the first face 1 near (1, 1, 0)" in each for each in found)
