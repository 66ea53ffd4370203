"""Batches: many deformations listed in a jobs file, run in parallel and resumable.

    jobs.yaml -> spec -> jobs -> (minus those the manifest lists as done) -> workers -> manifest
    -> summary

The names below are imported on first use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ffdcli.batch.events import StopSignal
    from ffdcli.batch.jobs import Job, list_jobs
    from ffdcli.batch.run import Outcome, run_batch
    from ffdcli.batch.spec import BatchSpec, json_schema
    from ffdcli.batch.summary import write_summary

_HOME = {
    "BatchSpec": "spec",
    "Job": "jobs",
    "Outcome": "run",
    "StopSignal": "events",
    "json_schema": "spec",
    "list_jobs": "jobs",
    "run_batch": "run",
    "write_summary": "summary",
}

__all__ = [
    "BatchSpec",
    "Job",
    "Outcome",
    "StopSignal",
    "json_schema",
    "list_jobs",
    "run_batch",
    "write_summary",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
