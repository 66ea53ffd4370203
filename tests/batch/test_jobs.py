"""The jobs file: the jobs it lists, and the messages about a wrong one."""

import re

import pytest

from ffdcli.batch import BatchSpec, json_schema, list_jobs
from ffdcli.errors import BatchError, FileError, LatticeError
from support.batch_models import fill_folder


@pytest.fixture
def write(tmp_path):
    fill_folder(tmp_path)

    def write(text):
        path = tmp_path / "jobs.yaml"
        path.write_text(text)
        return path

    return write


def test_a_list_of_jobs(write):
    first, second = list_jobs(
        write(
            "version: 1\nverify: true\noptions: {unit: cm, check: false}\njobs:\n"
            "  - {mesh: cube.obj, lattice: plain.yaml, output: a.step}\n"
            "  - {mesh: no.obj, lattice: plain.yaml, output: b.step, verify: {tolerance: 1e-3},\n"
            "     options: {unit: m, patches: bezier}}\n"
        )
    )
    assert (first.mesh, first.lattice, first.output) == ("cube.obj", "plain.yaml", "a.step")
    assert (first.verify, first.tolerance, first.scale) == (True, None, 1)
    assert first.options == {"unit": "cm", "check": False}
    # A file that is missing is for the job to say.
    assert second.mesh == "no.obj"
    assert second.tolerance == 1e-3
    assert second.options == {"unit": "m", "check": False, "patches": "bezier"}
    assert first.fingerprint != second.fingerprint


def test_a_matrix_in_order(write):
    jobs = list_jobs(
        write(
            "version: 1\njobs:\n"
            '  - mesh: ["[cs]*.obj", cube.obj]\n'
            '    lattice: "l*.yaml"\n'
            "    parameters: {height: [0, 0.5], way: [[0, 0, 1], a/b], on: true}\n"
            "    scale: [0.25, 1]\n"
            "    output: out/{folder}/{mesh}-{lattice}-{height}-{way}-{on}-"
            "{scale}-{number:03}.step\n"
        )
    )
    assert len(jobs) == 3 * 2 * 2 * 2
    assert [job.mesh for job in jobs[::8]] == ["cube.obj", "segv.obj", "slab.obj"]
    assert jobs[0].output == "out/./cube-lattice-0-0_0_1-true-0.25-001.step"
    assert jobs[7].output == "out/./cube-lattice-0.5-a_b-true-1-008.step"
    assert jobs[7].parameters == {"height": 0.5, "way": "a/b", "on": True}
    assert jobs[0].parameters["way"] == (0, 0, 1)
    assert jobs[0].scale == 0.25


def test_output_for_all_entries(write):
    text = "version: 1\noutput: '{mesh}.step'\njobs:\n  - {mesh: cube.obj, lattice: plain.yaml}\n"
    assert [job.output for job in list_jobs(write(text))] == ["cube.step"]


ONE = "{mesh: cube.obj, lattice: plain.yaml, output: a.step}"


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("", 1, "the jobs file is empty"),
        ("- 1\n", 1, "a jobs file has the keys"),
        ("version: 1\n", None, "jobs: this key is missing"),
        ("version: 2\njobs:\n  - {}\n", 1, "version: must be 1"),
        ("version: 1\njobs: []\n", 2, "jobs: must have at least one"),
        ("version: 1\njobs:\n  - {mesh: a}\n", 3, "jobs[0].lattice: this key is missing"),
        (f"version: 1\njobs:\n  - {ONE}\nvrify: true\n", 4, "did you mean `verify`?"),
        (f"version: 1\njobs: [{ONE}\n", None, "this is not valid YAML"),
        (f"version: 1\nversion: 1\njobs:\n  - {ONE}\n", 2, "the key is given twice"),
        ("version: 1\njobs:\n  - mesh: 3\n    lattice: a\n", 3, "jobs[0].mesh: must be text"),
        ("version: 1\njobs:\n  - mesh: []\n    lattice: a\n", 3, "must have at least one"),
        (f"version: 1\nverify: 1\njobs:\n  - {ONE}\n", 2, "must be true, false or {tolerance: T}"),
        (f"version: 1\nverify: {{tolerance: 0}}\njobs:\n  - {ONE}\n", 2, "must be greater than 0"),
        (f"version: 1\noptions: {{unit: ell}}\njobs:\n  - {ONE}\n", 2, "must be um, mm,"),
        ("version: 1\njobs:\n  - mesh: a\n    scale: .nan\n    lattice: b\n", 4, "finite number"),
        (
            "version: 1\njobs:\n  - mesh: a\n    lattice: b\n    parameters:\n      a b: 1\n",
            5,
            "the parameter name `a b` may consist",
        ),
        (
            "version: 1\njobs:\n  - mesh: a\n    lattice: b\n    parameters: {scale: 1}\n",
            5,
            "the name `scale` is reserved",
        ),
        (
            "version: 1\njobs:\n  - mesh: a\n    lattice: b\n    parameters:\n"
            "      ok: 1\n      x: {y: 1}\n",
            7,
            "jobs[0].parameters.x: must be a finite number, a string,",
        ),
        ("version: 1\njobs:\n  - {mesh: a, lattice: b}\n", 3, "has no output name"),
        (
            "version: 1\njobs:\n  - mesh: x*.obj\n    lattice: b\n    output: c\n",
            3,
            "no file matches `x*.obj`",
        ),
        (
            "version: 1\njobs:\n  - mesh: a\n    lattice: b\n    output: '{msh}.step'\n",
            5,
            "`{msh}` is not defined here (defined here: {mesh}, {lattice}",
        ),
        (
            "version: 1\njobs:\n  - mesh: a\n    lattice: b\n    output: '{mesh.step'\n",
            5,
            "this is not a valid pattern",
        ),
        (
            f"version: 1\njobs:\n  - {ONE}\n  - mesh: a\n    lattice: b\n    output: x/../a.step\n",
            6,
            "jobs 1 and 2 both write `x/../a.step`",
        ),
        (
            "version: 1\njobs:\n  - {mesh: a.stl, lattice: b, output: a.stl}\n",
            2,
            "job 1 would overwrite the input `a.stl`",
        ),
    ],
)
def test_messages(write, text, line, said):
    path = write(text)
    with pytest.raises(BatchError, match=re.escape(said)) as caught:
        list_jobs(path)
    assert caught.value.file == str(path)
    if line is not None:
        assert caught.value.line == line
    assert not isinstance(caught.value, LatticeError)
    assert "lattice file" not in str(caught.value)


def test_missing_jobs_file(tmp_path):
    with pytest.raises(FileError, match="there is no such file"):
        list_jobs(tmp_path / "no.yaml")


def test_schema_knows_every_key():
    schema = json_schema()
    assert schema["title"] == "ffd jobs file"
    assert set(schema["properties"]) == set(BatchSpec.model_fields)
    kinds = schema["$defs"]["Entry"]["properties"]["mesh"]["anyOf"]
    assert [kind["type"] for kind in kinds] == ["string", "array"]
