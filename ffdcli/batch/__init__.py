"""Batches: a jobs file turned into many runs of the main path, in parallel, resumable.

    jobs.yaml -> spec -> jobs -> (what the manifest says is done) -> workers -> manifest -> summary

The names below load on first use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ffdcli.batch.jobs import Job, list_jobs
    from ffdcli.batch.run import Brake, Outcome, run_batch
    from ffdcli.batch.spec import BatchSpec, json_schema
    from ffdcli.batch.summary import write_summary

_HOME = {
    "BatchSpec": "spec",
    "Brake": "run",
    "Job": "jobs",
    "Outcome": "run",
    "json_schema": "spec",
    "list_jobs": "jobs",
    "run_batch": "run",
    "write_summary": "summary",
}

__all__ = [
    "BatchSpec",
    "Brake",
    "Job",
    "Outcome",
    "json_schema",
    "list_jobs",
    "run_batch",
    "write_summary",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
