"""One job, from files to a record: the function that every worker runs, here or on a cluster."""

from __future__ import annotations

import hashlib
import os
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffdcli.batch.inputs import Digests, fetch_lattice, fetch_mesh
from ffdcli.batch.jobs import Job
from ffdcli.batch.places import absolute, is_url, store
from ffdcli.errors import BatchError, FfdError, FileError

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice
    from ffdcli.mesh import Mesh
    from ffdcli.pipeline import Plan
    from ffdcli.result import Result

Record = dict[str, Any]
Tell = Callable[[str], None]

# Statuses of a record. `rejected`: written, but the verification failed.
DONE, VERIFIED, FAILED, REJECTED = "done", "verified", "failed", "rejected"
PASSED = (DONE, VERIFIED)
# Options that go to the writer as they are, and the format they are for.
_WRITE_OPTIONS = {"unit": None, "target": None, "schema": "STEP", "iges_mode": "IGES"}


def run_job(job: Job, tell: Tell = lambda _stage: None, *, epoch: str | None = None) -> Record:
    """Do a job; whatever goes wrong with it ends up in the record.

    Parameters
    ----------
    job : Job
    tell : callable, optional
        Told the name of each stage as it begins.
    epoch : str, optional
        SOURCE_DATE_EPOCH of the batch, which settles the time stamps in outputs.

    Returns
    -------
    dict
        `status`, `stage` (where it ended), `seconds`, `inputs` (digests), and `error`, or
        `report`, `sha256` and `verification`.
    """
    # OpenCascade's settings, its silencing and the environment belong to the whole process.
    with _ONE_AT_A_TIME, _environment("SOURCE_DATE_EPOCH", epoch):
        stage = "start"
        record: Record = {}

        def begin(name: str) -> None:
            nonlocal stage
            # Without the amount that follows.
            stage = name.partition(":")[0]
            tell(stage)

        start = time.perf_counter()
        begin(stage)
        try:
            with tempfile.TemporaryDirectory(prefix="ffd-") as scratch:
                record |= _run(job, begin, scratch)
        except Exception as error:
            record |= {"status": FAILED, "error": error_facts(error)}
        return finished(job, record, stage=stage, seconds=time.perf_counter() - start)


def finished(job: Job, record: Record, *, stage: str, seconds: float) -> Record:
    """What the manifest holds of a job that has ended."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    kept = {"stage": stage, "seconds": round(seconds, 4), "finished": now}
    return {**job.settings, "fingerprint": job.fingerprint, "inputs": {}, **record, **kept}


def error_facts(error: Exception) -> dict[str, Any]:
    """The contract's error object for whatever stopped a job."""
    if isinstance(error, OSError) and not isinstance(error, FfdError):
        name = None if error.filename is None else str(error.filename)
        error = FileError((error.strerror or str(error) or "unusable").lower(), file=name)
    elif isinstance(error, MemoryError):
        hint = "use a smaller mesh or lattice, or fewer jobs at a time"
        error = FfdError("there is not enough memory", hint=hint)
    if isinstance(error, FfdError):
        fields = ("kind", "message", "file", "line", "key", "hint")
        return {name: getattr(error, name) for name in fields}
    said = " ".join(str(error).split()) or "no message"
    place = traceback.extract_tb(error.__traceback__)[-1:]
    at = f" at {Path(place[0].filename).name}:{place[0].lineno}" if place else ""
    message = f"internal error, please report it: {type(error).__name__}: {said}{at}"
    facts = dict.fromkeys(("file", "line", "key", "hint"))
    return {"kind": "internal", "message": message, **facts}


def _run(job: Job, begin: Tell, scratch: str) -> Record:
    """All stages of a job; a failure takes along what was read before it."""
    from ffdcli.brep.occ.formats import cad_format, require_writable

    target = Path(scratch, "out", Path(job.output).name)
    if not is_url(job.output):
        target = Path(absolute(job.folder, job.output))
    target.parent.mkdir(parents=True, exist_ok=True)
    require_writable(target)
    for name, kind in _WRITE_OPTIONS.items():
        if kind is not None and name in job.options and cad_format(target) != kind:
            hint = f"leave it out, or write {kind}"
            raise BatchError(f"the option `{name}` is for {kind} only", file=job.output, hint=hint)
    begin("read mesh")
    mesh, read = _mesh(job, scratch)
    begin("read lattice")
    lattice, links, warnings = fetch_lattice(job, mesh, scratch)
    inputs = read | links
    lattice = lattice.scaled(job.scale)
    plan = _plan(job, mesh, lattice, begin)
    result = _deform(job, plan, lattice, target, begin)
    report = result.report | {"output": job.output}
    report["warnings"] = [*warnings, *report["warnings"]]
    record: Record = {"status": DONE, "inputs": inputs, "report": report}
    if job.verify:
        begin("verify")
        record |= _verify(job, mesh, lattice, result, target)
    begin("store")
    record["sha256"] = _sha256(target)
    if is_url(job.output):
        store(target, job.output)
    return record


def _deform(job: Job, plan: Plan, lattice: Lattice, target: Path, begin: Tell) -> Result:
    options = job.options
    check = bool(options.get("check", True))
    result = plan.deform(
        lattice,
        tolerance=options.get("tolerance"),
        max_degree=options.get("max_degree"),
        target=options.get("target", "generic"),
        check=check,
        require_injective=bool(options.get("require_injective")),
        progress=begin,
    )
    chosen = {name: options[name] for name in _WRITE_OPTIONS if name in options}
    return result.write(target, check=check, progress=begin, **chosen)


def _verify(job: Job, mesh: Mesh, lattice: Lattice, result: Result, target: Path) -> Record:
    from ffdcli.verify.file import allowed_deviation, verify_file

    tolerance = job.tolerance
    if tolerance is None and not result.exact:
        tolerance = allowed_deviation(result.report, job.output, mesh)
    verdict = verify_file(
        target,
        mesh,
        lattice,
        tolerance=tolerance,
        expected_error=min(result.max_error, tolerance or 0.0),
        unit=result.unit,
    )
    facts = {
        name: None if isinstance(value, float) and not abs(value) < float("inf") else value
        for name, value in vars(verdict).items()
    }
    record: Record = {"status": VERIFIED if verdict.passed else REJECTED, "verification": facts}
    if not verdict.passed:
        reason = "; ".join(verdict.reasons) or "the file does not hold the deformation"
        facts = {"kind": "verification", "message": reason, "file": job.output}
        record["error"] = facts | dict.fromkeys(("line", "key", "hint"))
    return record


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@dataclass(frozen=True)
class _Kept:
    """The last mesh and its last plan, for the next job of this process."""

    digests: Digests
    repair: bool
    mesh: Mesh
    plan: Plan | None = None
    options: Mapping[str, Any] = field(default_factory=dict)


_ONE_AT_A_TIME = threading.Lock()
# Guarded by the lock.
_kept: list[_Kept] = []


def _mesh(job: Job, scratch: str) -> tuple[Mesh, Digests]:
    from ffdcli.mesh import read_mesh

    path, digests = fetch_mesh(job, scratch)
    repair = bool(job.options.get("repair"))
    if not _kept or (_kept[0].digests, _kept[0].repair) != (digests, repair):
        # What was kept goes first: two large plans at once might be too much.
        _kept.clear()
        _kept.append(_Kept(digests, repair, read_mesh(path, repair=repair)))
    return _kept[0].mesh, digests


def _plan(job: Job, mesh: Mesh, lattice: Lattice, begin: Tell) -> Plan:
    """The plan for the lattice's knots: the last one where it serves."""
    from ffdcli.fitting.lattice_fit import require_fit_tolerance
    from ffdcli.pipeline import prepare

    require_fit_tolerance(job.options.get("fit_tolerance"), lattice)
    options = {
        "patches": job.options.get("patches", "merged"),
        "require_solid": bool(job.options.get("require_solid")),
    }
    kept = _kept[0]
    if kept.plan is not None and kept.options == options and _serves(kept.plan, lattice):
        return kept.plan
    _kept[0] = replace(kept, plan=None)
    tolerance = job.options.get("fit_tolerance")
    plan = prepare(mesh, lattice, **options, fit_tolerance=tolerance, progress=begin)
    _kept[0] = replace(kept, plan=plan, options=options)
    return plan


def _serves(plan: Plan, lattice: Lattice) -> bool:
    """Same knots, and the same weights: rational pieces are cut by what their weights need."""
    import numpy as np

    pairs = zip(plan.volumes, lattice.maps, strict=False)
    return plan.fits(lattice.maps) and all(
        np.array_equal(made.net[..., 3:], asked.net[..., 3:]) for made, asked in pairs
    )


@contextmanager
def _environment(name: str, value: str | None) -> Iterator[None]:
    """A variable of the environment as the batch has it, for as long as a job runs."""
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
    """A job as plain JSON values, to be sent to a process."""
    return job.settings | {"folder": job.folder}


def from_task(task: Mapping[str, Any]) -> Job:
    """The job that :func:`as_task` made plain."""
    parameters = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in task["parameters"].items()
    }
    return Job(**{**task, "parameters": parameters})
