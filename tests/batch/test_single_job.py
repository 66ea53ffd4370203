"""One job in this process: its record, the plan it keeps, the files it reads."""

import json
from dataclasses import replace

import numpy as np
import pytest

from ffdcli import pipeline
from ffdcli.batch import single_job
from ffdcli.batch.inputs import fetch_lattice
from ffdcli.batch.jobs import Job
from ffdcli.batch.places import digest
from ffdcli.batch.summary import reason
from ffdcli.mesh import read_mesh
from support.batch_models import CUBE, PLAIN, fill_folder

EPOCH = "1700000000"


@pytest.fixture
def folder(tmp_path):
    single_job._kept.clear()
    return fill_folder(tmp_path)


@pytest.fixture
def job(folder):
    return Job("cube.obj", "lattice.yaml", "out/a.step", str(folder), {"height": 1})


def run(job, **settings):
    return single_job.run_job(job, epoch=EPOCH, **settings)


def test_record_of_a_verified_job(job, folder):
    stages = []
    record = run(replace(job, verify=True), progress=stages.append)
    assert record["status"] == "verified", record
    assert record["verification"]["max_deviation"] < 1e-11
    assert record["report"]["faces"] == 6
    assert record["sha256"] == digest(str(folder), "out/a.step")
    assert record["inputs"] == {name: digest(str(folder), name) for name in (job.mesh, job.lattice)}
    assert stages[:3] == ["start", "read mesh", "read lattice"]
    assert stages[-2:] == ["verify", "store"]
    assert [path.name for path in (folder / "out").iterdir()] == ["a.step"]
    json.dumps(record, allow_nan=False)


def test_coarse_planes_are_judged_by_what_the_report_states(job, folder):
    """Four decimals let a corner be off its planes by more than a millionth of the size."""
    (folder / "cube.obj").write_text(CUBE.replace("v 2 3 4", "v 2.0000 3.0000 4.0001"))
    record = run(replace(job, verify=True))
    stated = record["report"]["plane_deviation"]
    assert record["report"]["faces"] == 6
    assert record["status"] == "verified", record
    assert 1e-6 * np.sqrt(29) < record["verification"]["max_deviation"] <= stated
    assert record["verification"]["tolerance"] == stated


def test_kept_plan_gives_the_same_bytes(job, folder, monkeypatch):
    plans = []
    prepare = pipeline.prepare
    monkeypatch.setattr(pipeline, "prepare", lambda *a, **k: plans.append(1) or prepare(*a, **k))
    jobs = [
        replace(job, output=f"{height}-{scale}.step", parameters={"height": height}, scale=scale)
        for height in (1, 2)
        for scale in (0.5, 1)
    ]
    kept = [run(each)["sha256"] for each in jobs]
    assert len(plans) == 1
    single_job._kept.clear()
    alone = []
    for each in reversed(jobs):
        single_job._kept.clear()
        alone.append(run(each)["sha256"])
    assert alone[::-1] == kept
    assert len(set(kept)) == len(jobs)
    # Another partition, another mesh: another plan.
    run(replace(job, options={"patches": "bezier"}))
    run(replace(job, mesh="slab.obj"))
    assert len(plans) == 1 + 4 + 2


def test_changed_mesh_is_read_again(job, folder):
    before = run(job)
    (folder / "cube.obj").write_text(CUBE.replace("v 2 3 4", "v 2 3 5"))
    after = run(job)
    assert after["status"] == "done", after
    assert after["sha256"] != before["sha256"]
    assert after["inputs"]["cube.obj"] != before["inputs"]["cube.obj"]


@pytest.mark.parametrize(
    ("change", "stage", "said"),
    [
        ({"mesh": "no.obj"}, "read mesh", "no.obj: there is no such file"),
        ({"mesh": "plain.yaml"}, "read mesh", "plain.yaml: "),
        ({"lattice": "no.yaml"}, "read lattice", "no.yaml: there is no such file"),
        ({"lattice": "bad.yaml"}, "read lattice", "bad.yaml:6: edits[1].twist.angel: "),
        ({"parameters": {}}, "read lattice", "lattice.yaml:5: there is no value for ${height}"),
        (
            {"parameters": {"height": "high"}},
            "read lattice",
            "lattice.yaml:5: edits[0].move.by[2]: must be a number, not `high`",
        ),
        (
            {"mesh": "open.obj", "options": {"require_solid": True}},
            "check mesh",
            "open.obj: the mesh is open, and a solid is required",
        ),
        ({"output": "a.txt"}, "start", "cannot write a file of kind"),
        ({"options": {"iges_mode": "faces"}}, "start", "`iges_mode` is for IGES only"),
        ({"output": "cube.obj/a.step"}, "start", "cube.obj"),
    ],
)
def test_what_goes_wrong_is_in_the_record(job, change, stage, said):
    record = run(replace(job, **change))
    assert record["status"] == "failed"
    assert record["stage"] == stage
    assert said in reason(record)
    assert set(record["error"]) == {"kind", "message", "file", "line", "key", "hint"}
    assert "/ffd-" not in reason(record)


def test_open_mesh_where_no_solid_is_required(job):
    record = run(replace(job, mesh="open.obj"))
    assert record["status"] == "done", record
    assert any("open" in warning for warning in record["report"]["warnings"])


def test_rejected(job, folder):
    record = run(replace(job, verify=True, tolerance=1e-300))
    assert record["status"] == "rejected"
    assert record["error"]["kind"] == "verification"
    assert (folder / "out" / "a.step").exists()


@pytest.mark.parametrize(
    ("output", "options", "said"),
    [
        ("a.step", {"schema": "ap242", "unit": "inch"}, b"AP242"),
        ("a.igs", {"iges_mode": "faces"}, b"4HINCH"),
        ("a.brep", {}, b"CASCADE Topology"),
    ],
)
def test_formats(job, folder, output, options, said):
    record = run(replace(job, output=output, options={"unit": "inch", **options}))
    assert record["status"] == "done", record
    assert said in (folder / output).read_bytes()[:5000]


@pytest.mark.parametrize("kind", [MemoryError, type("Standard_OutOfMemory", (Exception,), {})])
def test_memory_runs_out(job, monkeypatch, kind):
    def exhausted(*_, **__):
        raise kind

    monkeypatch.setattr(pipeline, "prepare", exhausted)
    record = run(job)
    assert record["status"] == "failed"
    assert "not enough memory" in reason(record)


def test_parameter_that_does_not_occur(job):
    record = run(replace(job, parameters={"height": 1, "width": 2}))
    assert "the lattice file does not use the parameter width" in record["report"]["warnings"]


@pytest.mark.parametrize("net", ["net.npy", "nets/net.npy", "../nets/net.npy"])
@pytest.mark.parametrize("filled", [False, True])
def test_files_that_a_lattice_names(folder, net, filled):
    home = folder / "lattices"
    home.mkdir()
    rest = np.stack(np.meshgrid([0, 1, 2], [0, 1.5, 3], [0, 2, 4], indexing="ij"), axis=-1)
    rest[2, 2, 2] += 1
    (home / net).parent.mkdir(exist_ok=True)
    np.save(home / net, rest)
    text = PLAIN.split("edits")[0] + f"edits:\n  - net: {net}\n"
    (home / "l.yaml").write_text(text + ("  - twist: {axis: w, angle: ${angle}}\n" * filled))
    parameters = {"angle": 10} if filled else {}
    job = Job("cube.obj", "lattices/l.yaml", "a.step", str(folder), parameters)
    mesh = read_mesh(folder / "cube.obj")
    scratch = folder / "scratch"
    scratch.mkdir()
    lattice, digests, _ = fetch_lattice(job, mesh, str(scratch))
    assert lattice.volume.net[2, 2, 2, 2] == 5
    assert set(digests) == {"lattices/l.yaml", f"lattices/{net}"}


def test_urls(folder):
    fsspec = pytest.importorskip("fsspec")
    system = fsspec.filesystem("memory")
    for name in ("cube.obj", "lattice.yaml"):
        system.pipe(f"/in/{name}", (folder / name).read_bytes())
    local = run(Job("cube.obj", "lattice.yaml", "a.step", str(folder), {"height": 1}))
    place = "memory://in/"
    job = Job(f"{place}cube.obj", f"{place}lattice.yaml", "memory://out/a.step", "/", {"height": 1})
    record = run(job)
    assert record["status"] == "done", record
    assert record["sha256"] == local["sha256"] == digest("/", "memory://out/a.step")
    missing = run(replace(job, mesh=f"{place}no.obj"))
    assert reason(missing).startswith("memory://in/no.obj: there is no such file")
    bad = run(replace(job, parameters={"height": "high"}))
    assert reason(bad).startswith("memory://in/lattice.yaml:5: edits[0].move.by[2]")
    file_url = run(replace(job, output=f"file://{folder}/b.step"))
    assert file_url["status"] == "done"
    assert (folder / "b.step").exists()


def test_several_lattices_share_one_plan(job, folder, monkeypatch):
    plans = []
    prepare = pipeline.prepare
    monkeypatch.setattr(pipeline, "prepare", lambda *a, **k: plans.append(1) or prepare(*a, **k))
    (folder / "lattice.yaml").write_text(
        "version: 1\nlattices:\n"
        "  - box: {min: [-1, -1, -1], max: [3, 4, 1.5]}\n"
        "    edits: [{move: {at: [2, 3, 2], by: [0, ${height}, 0]}}]\n"
        "  - box: {min: [-1, -1, 2], max: [3, 4, 5]}\n    degree: [2, 2, 2]\n"
    )
    jobs = [
        replace(job, output=f"{height}.step", parameters={"height": height}, verify=True)
        for height in (0.1, 0.2)
    ]
    assert [run(each)["status"] for each in jobs] == ["verified"] * 2
    assert len(plans) == 1


def test_strips_between_close_knots_are_cut_for_their_own_net_alone(job, folder, monkeypatch):
    """Faces that a job leaves planes are whole, whatever the jobs before were."""
    plans = []
    prepare = pipeline.prepare
    monkeypatch.setattr(pipeline, "prepare", lambda *a, **k: plans.append(1) or prepare(*a, **k))
    # A plate askew to the axes, its large faces long strips between the close knots.
    normal = np.array([4, 1, 0.8]) / np.linalg.norm([4, 1, 0.8])
    along = np.cross(normal, [0, 0, 1]) / np.linalg.norm(np.cross(normal, [0, 0, 1]))
    corners = [[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.1, 0.1)]
    placed = corners @ np.array([along, np.cross(normal, along), normal])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in placed.tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1} {d + 1}" for a, b, c, d in quads]
    (folder / "cube.obj").write_text("\n".join(lines) + "\n")
    (folder / "lattice.yaml").write_text(
        "version: 1\ndegree: [3, 3, 3]\npoints: [6, 4, 4]\nknots: [[0.4, 0.4001], [], []]\n"
        "edits:\n  - move: {at: [3, 2, 2], by: [0, ${height}, 0]}\n"
    )
    jobs = [
        replace(job, output=f"{number}.step", parameters={"height": height})
        for number, height in enumerate((0, 0.02, 0.02, 0))
    ]
    found = [run(each) for each in jobs]
    assert [each["status"] for each in found] == ["done"] * 4
    assert len(plans) == 3
    faces = [each["report"]["faces"] for each in found]
    assert faces[0] < faces[1]
    assert faces == [faces[0], faces[1], faces[1], faces[0]]
