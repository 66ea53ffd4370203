"""What a report states is used, or the report is refused in one sentence."""

import json

import pytest
from click.testing import CliRunner

from ffdcli.cli.main import main
from ffdcli.errors import FileError
from ffdcli.verify.file import allowed_deviation
from support.jobs import ellipsoid

GOOD = {"max_error": 1e-3, "plane_deviation": 2e-3, "fit": None}


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    return ellipsoid(tmp_path_factory.mktemp("mesh"), 1)


def test_the_deviations_of_a_report_are_added(mesh):
    assert allowed_deviation(GOOD, "r.json", mesh) == pytest.approx(3e-3, rel=1e-12)
    more = {**GOOD, "interpolation_error": 4e-3}
    assert allowed_deviation(more, "r.json", mesh) == pytest.approx(7e-3, rel=1e-12)


@pytest.mark.parametrize(
    "change",
    [
        {"max_error": 10**5000},
        {"max_error": True},
        {"max_error": "0"},
        {"plane_deviation": [0]},
        {"plane_deviation": float("nan")},
        {"interpolation_error": "much"},
        {"interpolation_error": -1},
        {"fit": "yes"},
        {"fit": {"lattices": 3}},
        {"fit": {"lattices": [3]}},
        {"fit": {"lattices": [{"lattice": 0}]}},
        {"fit": {"lattices": [{"lattice": 0, "bound": 10**400}]}},
    ],
)
def test_other_values_are_refused(mesh, change):
    with pytest.raises(FileError, match="not a report of ffd deform") as caught:
        allowed_deviation({**GOOD, **change}, "r.json", mesh)
    assert caught.value.file == "r.json"
    assert caught.value.hint


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        "{",
        json.dumps([GOOD]),
        '{"max_error": ' + "9" * 5000 + ', "plane_deviation": 0}',
        "3",
        "null",
    ],
)
def test_what_is_no_report_ends_in_one_sentence(tmp_path, text):
    ellipsoid(tmp_path, 1)
    (tmp_path / "r.json").write_text(text)
    (tmp_path / "l.yaml").write_text("version: 1\n")
    mesh = tmp_path / "ball.obj"
    done = CliRunner().invoke(
        main,
        ["verify", "none.step", str(mesh), str(tmp_path / "l.yaml"), "--against"]
        + [str(tmp_path / "r.json")],
    )
    assert done.exit_code == 1
    assert "not a report of ffd deform" in done.stderr
    assert "internal" not in done.stderr
