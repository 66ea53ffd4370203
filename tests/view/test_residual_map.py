"""The picture of the residual of a fit."""

import numpy as np
import pytest

from ffdcli import read_lattice, read_mesh
from ffdcli.errors import LatticeError
from ffdcli.view.residual_map import residual_colours, residual_panel
from support.plain_files import CUBE

FIELD = """\
version: 1
edits:
  - fit:
      pairs: [{from: [0, 0, 0], by: [0, 0, 0.2]}, {from: [0, 0, 0], by: [0, 0, 0]}]
"""


def load(folder, text):
    (folder / "cube.obj").write_text(CUBE)
    (folder / "l.yaml").write_text(text)
    mesh = read_mesh(folder / "cube.obj")
    return mesh, read_lattice(folder / "l.yaml", mesh)


def test_marks_are_where_the_images_are(tmp_path):
    panel = residual_panel(*load(tmp_path, FIELD))
    marks = panel.parts[0]
    # Both pairs have one place, and are shifted half way.
    np.testing.assert_allclose(marks.points.reshape(2, 6, 3).mean(axis=1), [[0, 0, 0.1]] * 2)
    assert "2 pairs, rms 0.1 mm, largest 0.1, 0.0% within" in panel.title
    assert panel.scale.high == pytest.approx(0.1)
    np.testing.assert_allclose(marks.colours[0], residual_colours(np.ones(1))[0])


def test_a_lattice_without_a_fit_is_refused(tmp_path):
    with pytest.raises(LatticeError, match="--residual needs a lattice with a `fit`"):
        residual_panel(*load(tmp_path, "version: 1\n"))
