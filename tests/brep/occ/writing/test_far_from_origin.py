"""STEP files of models far from the origin: read by OpenCascade, or refused before they appear."""

from contextlib import suppress
from dataclasses import replace

import pytest

from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.reading.read import read_cad
from ffdcli.brep.occ.writing.write import write_cad
from ffdcli.errors import CheckError
from support import brep_models as models


def far(offset):
    """A cube of 2e6, its vertices off the ends of their curves as far as flawed planes let them."""
    brep = models.cube(lambda points: 2e6 * models.bumpy(points) + offset)
    inward = brep.points.mean(axis=0) - brep.points
    return build_shape(replace(brep, points=brep.points + 1e-9 * inward))


@pytest.mark.parametrize("offset", [0, 1e6, 1e7, 1e8, 2e8, 5e8, 1e9, 1e10])
def test_step_files_are_read_or_refused(offset, tmp_path):
    path = tmp_path / "far.step"
    with suppress(CheckError):
        write_cad(far(offset), path)
    assert path.exists() or offset > 1e7
    if path.exists():
        read_cad(path)


def test_a_model_far_from_the_origin_is_refused_with_the_cause(tmp_path):
    with pytest.raises(CheckError, match=r"only 0 of the 1 parts .* rounded by 1\.2e-07") as caught:
        write_cad(far(1e9), tmp_path / "far.step")
    assert caught.value.hint == "move the model nearer to the origin, or write .brep or .iges"
    for kind in ("brep", "iges"):
        write_cad(far(1e9), tmp_path / f"far.{kind}")
        read_cad(tmp_path / f"far.{kind}")
    assert not (tmp_path / "far.step").exists()
