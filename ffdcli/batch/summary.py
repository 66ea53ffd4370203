"""The summary of a batch: a .csv table with one row per job."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

from ffdcli.batch.run import Outcome
from ffdcli.batch.single_job import Record
from ffdcli.files import write_whole
from ffdcli.messages import printable

COLUMNS = (
    "output",
    "status",
    "kept",
    "stage",
    "reason",
    "mesh",
    "lattice",
    "parameters",
    "scale",
    "faces",
    "solids",
    "watertight",
    "bytes",
    "max_deviation",
    "seconds",
    "finished",
    "sha256",
)


def write_summary(outcome: Outcome, path: str | Path) -> None:
    """Write the table.

    Raises
    ------
    FileError
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(_row(record, outcome) for record in outcome.records)
    write_whole(path, text.getvalue().encode())


def reason(record: Record) -> str:
    """Reason why a job did not pass, in one line; empty if it passed."""
    error = record.get("error")
    if not error:
        return ""
    place = ":".join(str(error[name]) for name in ("file", "line") if error.get(name) is not None)
    parts = [part for part in (place, error.get("key"), error["message"]) if part]
    hint = f" ({error['hint']})" if error.get("hint") else ""
    return ": ".join(parts) + hint


def _row(record: Record, outcome: Outcome) -> dict[str, Any]:
    facts: dict[str, Any] = record.get("report", {}) | record.get("verification", {})
    row = {name: value for name, value in (facts | record).items() if name in COLUMNS}
    row["parameters"] = json.dumps(record["parameters"]) if record["parameters"] else ""
    row["kept"] = "yes" if record["output"] in outcome.kept else ""
    row["reason"] = reason(record)
    return {name: printable(v) if isinstance(v, str) else v for name, v in row.items()}
