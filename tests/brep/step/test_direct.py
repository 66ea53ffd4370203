"""The direct writer in the place of OpenCascade: what it asks of it, and what it refuses."""

from dataclasses import replace

import pytest

from ffdcli.brep.labels import label_shape
from ffdcli.brep.step.direct import DirectWriter
from ffdcli.errors import CheckError
from support import brep_models as models


def test_a_model_far_from_the_origin_is_refused_with_the_cause(tmp_path):
    brep = models.cube(lambda points: 2e6 * models.bumpy(points) + 1e9)
    # Its vertices are off the ends of their curves as far as flawed planes let them.
    inward = brep.points.mean(axis=0) - brep.points
    brep = replace(brep, points=brep.points + 1e-9 * inward)
    writer = DirectWriter(brep, None)
    with pytest.raises(CheckError, match=r"only 0 of the 1 parts .* rounded by 1\.2e-07"):
        writer.write(tmp_path / "far.step", labels=label_shape(brep, "far", None))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("mapping", [models.bumpy, models.projective])
def test_the_same_bytes_with_a_judge_and_without(mapping, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    brep, asked, contents = models.cube(mapping), [], []

    class Judge:
        def __getattr__(self, name):
            return lambda *_: asked.append(name)

    labels = label_shape(brep, "a", None)
    for judge in (None, Judge()):
        writer = DirectWriter(brep, judge)
        writer.load()
        writer.build(brep)
        writer.begin_check()
        verdicts = []
        writer.write(tmp_path / "a.step", agree=verdicts.append, labels=labels)
        assert len(verdicts) == (judge is not None)
        contents.append((tmp_path / "a.step").read_bytes())
    assert asked == ["load", "build", "begin_check", "verdict"]
    assert contents[0] == contents[1]
