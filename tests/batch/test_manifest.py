"""The manifest: whole lines only, one batch at a time, and what it takes to be done."""

import json
from dataclasses import replace

import pytest

from ffdcli.batch.jobs import Job
from ffdcli.batch.manifest import Manifest, is_current
from ffdcli.batch.places import digest
from ffdcli.errors import BatchError, FileError


def test_unfinished_line_is_no_record(tmp_path):
    path = tmp_path / "m.jsonl"
    path.write_bytes(b'{"output": "a", "status": "done"}\n{"output": "b", "sta')
    with Manifest(path) as book:
        assert set(book.records) == {"a"}
        book.append({"output": "c", "status": "done"})
        book.append({"output": "a", "status": "failed"})
    with Manifest(path) as book:
        assert {name: record["status"] for name, record in book.records.items()} == {
            "a": "failed",
            "c": "done",
        }
    assert json.loads(path.read_bytes().splitlines()[2])["output"] == "c"


def test_one_batch_at_a_time(tmp_path):
    path = tmp_path / "m.jsonl"
    with Manifest(path), pytest.raises(BatchError, match="another batch is using"):
        Manifest(path)
    with Manifest(path):
        pass


def test_no_folder(tmp_path):
    with pytest.raises(FileError, match="folder for this file does not exist"):
        Manifest(tmp_path / "no" / "m.jsonl")


def test_what_makes_a_job_current(tmp_path):
    for name in ("mesh", "lattice", "output"):
        (tmp_path / name).write_text(name)
    job = Job("mesh", "lattice", "output", str(tmp_path))
    record = {
        "status": "done",
        "fingerprint": job.fingerprint,
        "inputs": {name: digest(str(tmp_path), name) for name in ("mesh", "lattice")},
        "sha256": digest(str(tmp_path), "output"),
    }
    assert is_current(job, record, digest)
    assert not is_current(job, None, digest)
    assert not is_current(job, {**record, "status": "failed"}, digest)
    assert not is_current(job, {**record, "status": "rejected"}, digest)
    assert not is_current(replace(job, scale=0.5), record, digest)
    assert not is_current(replace(job, verify=True), record, digest)
    # The same jobs in another folder are the same jobs.
    assert replace(job, folder="/elsewhere").fingerprint == job.fingerprint
    for name in ("mesh", "output"):
        (tmp_path / name).write_text("changed")
        assert not is_current(job, record, digest)
        (tmp_path / name).unlink()
        assert not is_current(job, record, digest)
        (tmp_path / name).write_text(name)
    assert is_current(job, record, digest)
