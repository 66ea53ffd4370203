"""Jobs files that would take memory without bound, or write a file twice, are refused."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.batch import list_jobs, places
from ffdcli.errors import BatchError, FfdError
from support.batch_models import fill_folder
from support.damage import damage


@pytest.fixture
def refused(tmp_path):
    fill_folder(tmp_path)

    def refused(text):
        path = tmp_path / "jobs.yaml"
        path.write_text("version: 1\n" + text)
        with pytest.raises(BatchError) as caught:
            list_jobs(path)
        assert caught.value.file == str(path)
        return caught.value

    return refused


@pytest.mark.parametrize(
    "field",
    [
        "{mesh:>1000000000}",
        "{mesh:.1000000000}",
        "{number:0100}",
        "{number:1000000000d}",
        "{mesh:{lattice}}",
        "{mesh:{number}}",
        "{mesh.__class__}",
        "{mesh[0]}",
        "{nothing}",
        "{}",
        "{0}",
        "{mesh:d}",
        "{number:q}",
        "{mesh!x}",
        "{mesh",
        "a\\0b",
    ],
)
def test_patterns_other_than_short_fields_are_refused(refused, field):
    error = refused(f'output: "{field}.step"\njobs:\n  - {{mesh: cube.obj, lattice: plain.yaml}}\n')
    assert (error.line, error.key) == (2, "output")
    assert len(str(error)) < 500


def test_short_formats_are_filled_in(tmp_path):
    fill_folder(tmp_path)
    path = tmp_path / "jobs.yaml"
    path.write_text(
        'version: 1\noutput: "{number:04}-{scale:.2f}-{mesh:_>6}.step"\n'
        "jobs:\n  - {mesh: cube.obj, lattice: plain.yaml, scale: 0.5}\n"
    )
    assert [job.output for job in list_jobs(path)] == ["0001-0.50-__cube.step"]


def test_combinations_are_counted_before_they_are_listed(refused):
    parameters = ", ".join(f"{name}: [{', '.join(map(str, range(1000)))}]" for name in "abcd")
    error = refused(
        "jobs:\n  - mesh: cube.obj\n    lattice: plain.yaml\n    output: '{number}.step'\n"
        f"    parameters: {{{parameters}}}\n"
    )
    assert f"{1000**4:,} jobs" in error.message
    assert error.key == "jobs[0]"


def test_outputs_that_a_link_makes_one_file_are_refused(refused, tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "here").symlink_to("there")
    one = "  - {mesh: cube.obj, lattice: plain.yaml, output: %s/a.step}\n"
    error = refused("jobs:\n" + one % "here" + one % "there")
    assert "jobs 1 and 2 both write" in error.message


def test_outputs_that_differ_in_case_are_one_file_where_case_is_ignored(refused, monkeypatch):
    one = "  - {mesh: cube.obj, lattice: plain.yaml, output: %s.step}\n"
    monkeypatch.setattr(places, "_real_folder", lambda folder: (folder, True))
    assert "both write" in refused("jobs:\n" + one % "A" + one % "a").message


def test_an_output_that_is_an_input_through_a_link_is_refused(refused, tmp_path):
    (tmp_path / "here").symlink_to(".")
    text = "jobs:\n  - {mesh: cube.obj, lattice: plain.yaml, output: here/cube.obj}\n"
    assert "would overwrite the input" in refused(text).message


GOOD = b"""version: 1
output: "out/{mesh}-{a}-{number:03}.step"
options: {tolerance: 1e-3, max_degree: 5}
jobs:
  - mesh: [cube.obj]
    lattice: plain.yaml
    parameters: {a: [1, 2.5, true, "x y"], b: &b [[1, 2], [3, 4]]}
    scale: [0, 0.5, 1]
    verify: {tolerance: 1e-6}
"""
BITS = (b"{", b"}", b"{mesh:>99999}", b"*b", b"!x ", b"9" * 5000, b"1e999", b'"\\0"', b"[" * 30)
BITS += (b"\n", b"\0", b": ", b"\xff", b"**", b"- ", b"..")


@settings(max_examples=100, deadline=None, derandomize=True, database=None)
@given(st.data())
def test_damaged_jobs_files_are_read_or_refused(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("damaged")
    (folder / "cube.obj").touch()
    path = folder / "jobs.yaml"
    path.write_bytes(damage(GOOD, data, BITS))
    refusal, jobs = None, []
    try:
        jobs = list_jobs(path)
    except FfdError as error:
        refusal = error
    if refusal is None:
        assert all(job.output for job in jobs)
        return
    assert refusal.file == str(path)
    assert len(refusal.message) < 400
