"""Run one job, from its input files to its record: the function that all workers call."""

from __future__ import annotations

import hashlib
import os
import tempfile
import threading
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffdcli.batch.inputs import Digests, fetch_lattice, fetch_mesh
from ffdcli.batch.jobs import Job
from ffdcli.batch.places import absolute, is_url, store
from ffdcli.errors import BatchError, FfdError, FileError, lacks_memory
from ffdcli.stopwatch import Progress

if TYPE_CHECKING:
    from ffdcli.forecast import Work
    from ffdcli.lattice import Lattice
    from ffdcli.mesh import Mesh
    from ffdcli.part.plan import PartPlan
    from ffdcli.part.record import Part
    from ffdcli.part.result import PartResult
    from ffdcli.pipeline import Plan
    from ffdcli.result import Result

Record = dict[str, Any]

# Status of a record. `rejected`: the output was written but failed verification.
DONE, VERIFIED, FAILED, REJECTED = "done", "verified", "failed", "rejected"
PASSED = (DONE, VERIFIED)
# Options by the function that takes them; those not given have its defaults.
_PREPARE = ("patches", "coplanar", "fit_tolerance", "require_solid")
_DEFORM = ("tolerance", "max_degree", "target", "check", "require_injective")
_WRITE = ("unit", "schema", "iges_mode", "writer", "check")
# Options for one format only.
_FORMAT = {"schema": "STEP", "iges_mode": "IGES"}


def run_job(
    job: Job, progress: Progress = lambda _stage: None, *, epoch: str | None = None
) -> Record:
    """Run a job; errors are stored in the record.

    Parameters
    ----------
    job : Job
    progress : callable, optional
        Called with the name of each stage as it begins.
    epoch : str, optional
        SOURCE_DATE_EPOCH of the batch: the time stamp in outputs.

    Returns
    -------
    dict
        `status`, `stage` (the last one), `seconds`, `inputs` (digests), and `error`, or `report`,
        `sha256` and `verification`.
    """
    # The environment, and settings and output of OpenCascade, belong to the whole process.
    with _ONE_AT_A_TIME, _environment("SOURCE_DATE_EPOCH", epoch):
        stage = "start"
        record: Record = {}

        def begin(name: str) -> None:
            nonlocal stage
            # The name may be followed by an amount.
            stage = name.partition(":")[0]
            progress(stage)

        start = time.perf_counter()
        begin(stage)
        try:
            with tempfile.TemporaryDirectory(prefix="ffd-") as scratch:
                record |= _run(job, begin, scratch)
        except Exception as error:
            record |= {"status": FAILED, "error": error_facts(error)}
        return finished(job, record, stage=stage, seconds=time.perf_counter() - start)


def finished(job: Job, record: Record, *, stage: str, seconds: float) -> Record:
    """Record of a job that has ended, for the manifest."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    kept = {"stage": stage, "seconds": round(seconds, 4), "finished": now}
    return {**job.settings, "fingerprint": job.fingerprint, "inputs": {}, **record, **kept}


def error_facts(error: Exception) -> dict[str, Any]:
    """Fields of the error that ended a job: kind, message, file, line, key, hint."""
    if isinstance(error, OSError) and not isinstance(error, FfdError):
        name = None if error.filename is None else str(error.filename)
        error = FileError((error.strerror or str(error) or "unusable").lower(), file=name)
    elif lacks_memory(error) and not isinstance(error, FfdError):
        hint = "use a smaller mesh or lattice, or fewer jobs at a time"
        error = FfdError("there is not enough memory", hint=hint)
    if isinstance(error, FfdError):
        fields = ("kind", "message", "file", "line", "key", "hint")
        return {name: getattr(error, name) for name in fields}
    detail = " ".join(str(error).split()) or "no message"
    place = traceback.extract_tb(error.__traceback__)[-1:]
    at = f" at {Path(place[0].filename).name}:{place[0].lineno}" if place else ""
    message = f"internal error, please report it: {type(error).__name__}: {detail}{at}"
    facts = dict.fromkeys(("file", "line", "key", "hint"))
    return {"kind": "internal", "message": message, **facts}


def _run(job: Job, begin: Progress, scratch: str) -> Record:
    """All stages of a job."""
    from ffdcli.brep.occ.formats import cad_format, require_writable, require_writer

    target = Path(scratch, "out", Path(job.output).name)
    if not is_url(job.output):
        target = Path(absolute(job.folder, job.output))
    target.parent.mkdir(parents=True, exist_ok=True)
    require_writable(target)
    require_writer(target, job.options.get("writer", "kernel"))
    for name, kind in _FORMAT.items():
        if name in job.options and cad_format(target) != kind:
            hint = f"remove it, or write a {kind} file"
            raise BatchError(f"the option `{name}` is for {kind} only", file=job.output, hint=hint)
    begin("read mesh")
    model, read = _model(job, scratch)
    begin("read lattice")
    lattice, links, warnings = fetch_lattice(job, model, scratch)
    inputs = read | links
    lattice = lattice.scaled(job.scale)
    result = _plan(job, model, lattice, begin).deform(
        lattice, **_chosen(job, _DEFORM), progress=begin
    )
    result = result.write(target, **_chosen(job, _WRITE), progress=begin)
    report = result.report | {"output": job.output}
    report["warnings"] = [*warnings, *report["warnings"]]
    record: Record = {"status": DONE, "inputs": inputs, "report": report}
    if job.verify:
        begin("verify")
        record |= _verify(job, model, lattice, result, target)
    begin("store")
    record["sha256"] = _sha256(target)
    if is_url(job.output):
        store(target, job.output)
    return record


def _chosen(job: Job, names: Sequence[str]) -> dict[str, Any]:
    """The options of a job with these names."""
    return {name: job.options[name] for name in names if name in job.options}


def _verify(
    job: Job, model: Mesh | Part, lattice: Lattice, result: Result | PartResult, target: Path
) -> Record:
    from ffdcli.models import verify_model

    # What the run itself states, as with `ffd verify --against`.
    verdict = verify_model(
        target,
        model,
        lattice,
        tolerance=job.tolerance,
        stated=result.report,
        source=job.output,
        unit=result.unit,
    )
    facts = {
        name: None if isinstance(value, float) and not abs(value) < float("inf") else value
        for name, value in vars(verdict).items()
    }
    record: Record = {"status": VERIFIED if verdict.passed else REJECTED, "verification": facts}
    if not verdict.passed:
        reason = "; ".join((*verdict.reasons, *verdict.undecided))
        facts = {"kind": "verification", "message": reason, "file": job.output}
        record["error"] = facts | dict.fromkeys(("line", "key", "hint"))
    return record


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@dataclass(frozen=True)
class _Kept:
    """The last mesh or part, and its plan, kept for the next job of this process."""

    digests: Digests
    repair: bool
    model: Mesh | Part
    plan: Plan | PartPlan | None = None
    prepared_with: Mapping[str, Any] = field(default_factory=dict)


_ONE_AT_A_TIME = threading.Lock()
# Guarded by the lock.
_kept: list[_Kept] = []


def _model(job: Job, scratch: str) -> tuple[Mesh | Part, Digests]:
    from ffdcli.models import read_model

    path, digests = fetch_mesh(job, scratch)
    repair = bool(job.options.get("repair"))
    if not _kept or (_kept[0].digests, _kept[0].repair) != (digests, repair):
        # Free the old plan first: two large plans may not fit into memory.
        _kept.clear()
        _kept.append(_Kept(digests, repair, read_model(path, repair=repair)))
    return _kept[0].model, digests


def _plan(job: Job, model: Mesh | Part, lattice: Lattice, begin: Progress) -> Plan | PartPlan:
    """A plan for the knots of the lattice: the last one if no file depends on that."""
    from ffdcli.pipeline import Coplanar, prepare

    kept, options = _kept[0], _chosen(job, _PREPARE)
    if "coplanar" in options:
        options["coplanar"] = Coplanar(**options["coplanar"])
    if kept.plan is not None and kept.prepared_with == options and kept.plan.serves(lattice):
        return kept.plan
    _kept[0] = replace(kept, plan=None)
    plan = prepare(model, lattice, **options, once=True, work=_work(job), progress=begin)
    _kept[0] = replace(kept, plan=plan, prepared_with=options)
    return plan


def _work(job: Job) -> Work:
    """What a job does with its surfaces, so that the memory it takes is foreseen."""
    from ffdcli.forecast import Work

    writer, check = job.options.get("writer", "kernel"), job.options.get("check", True)
    return Work.writing(job.output, writer, check, **_chosen(job, ("tolerance", "max_degree")))


@contextmanager
def _environment(name: str, value: str | None) -> Iterator[None]:
    """Set an environment variable inside the block, and restore it afterwards."""
    before = os.environ.get(name)
    try:
        _set(name, value)
        yield
    finally:
        _set(name, before)


def _set(name: str, value: str | None) -> None:
    if value is None:
        os.environ.pop(name, None)
    else:
        os.environ[name] = value


def as_task(job: Job) -> Mapping[str, Any]:
    """A job as plain JSON values, to send it to a process."""
    return job.settings | {"folder": job.folder}


def from_task(task: Mapping[str, Any]) -> Job:
    """The job that :func:`as_task` converted."""
    parameters = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in task["parameters"].items()
    }
    return Job(**{**task, "parameters": parameters})
