"""What became of the files of a corpus, as a table in Markdown."""

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ffdcli.brep.occ.formats import cad_format
from ffdcli.mesh.soundness.fault_messages import FAULTS
from ffdcli.messages import printable

MADE, REPAIRED, REFUSED, WRONG = "made and verified", "made with `--repair`", "refused", "wrong"
UNDECIDED, FAULTY, LATE, MEMORY = "undecided", "not valid as read", "too slow", "out of memory"
OUTCOMES = (MADE, REPAIRED, REFUSED, WRONG, UNDECIDED, FAULTY, LATE, MEMORY)
MESHES, PARTS = "meshes", "CAD parts"
# Errors that are no refusals, beside those that ask for a report.
FAILURES = ("internal", "kernel", "crash", "error")
FOLDED = "the lattice folds the model over"
SLOWEST = 5


@dataclass(frozen=True)
class Corpus:
    """The files of some folders: models to run, and counts of those that are not run.

    Parameters
    ----------
    models : list of str
        Absolute paths of meshes and CAD parts, in an order by chance, so that those run first are a
        fair sample.
    names : dict of str to str
        Paths relative to the folders, for the table.
    left_out : dict of str to int
        Number of files by the reason why they are not run.
    """

    models: list[str]
    names: dict[str, str]
    left_out: dict[str, int]


@dataclass(frozen=True)
class Run:
    """A model that has run: its path, its name in the table, the degree, the record of the job."""

    model: str
    name: str
    degree: int
    record: dict[str, Any]

    @property
    def kind(self) -> str:
        """Whether the model is a mesh or a CAD part."""
        return PARTS if cad_format(self.model) else MESHES

    @property
    def where(self) -> str:
        """The name without its middle."""
        folders = self.name.split("/")
        return "/".join(folders if len(folders) < 6 else [*folders[:2], "...", *folders[-2:]])

    @cached_property
    def outcome(self) -> str:
        """What became of the job."""
        record = self.record
        if "report" in record:
            return self._judged()
        error = record["error"]
        if error["kind"] == "timeout":
            return LATE
        if re.search("not enough memory|out of memory|bad_alloc", error["message"]):
            return MEMORY
        asked = "please report it" in f"{error['message']} {error['hint']}"
        return WRONG if asked or error["kind"] in FAILURES else REFUSED

    def _judged(self) -> str:
        """What became of a job whose file was written and verified."""
        report, found = self.record["report"], self.record["verification"]
        read = report.get("part") or report["mesh"]
        if not read.get("valid", True):
            return FAULTY
        if self.record["status"] == "rejected":
            return WRONG if found["reasons"] else UNDECIDED
        if not found["valid"] or found["watertight"] != read["closed"]:
            return WRONG
        return REPAIRED if self.record["options"].get("repair") else MADE

    @property
    def message(self) -> str:
        """Why no verified file was made."""
        found = self.record.get("verification", {})
        said = [self.record.get("error", {}).get("message"), *found.get("reasons", [])]
        said += found.get("undecided", [])
        return "; ".join(filter(None, said)) or "the file is not valid, or not closed"

    @property
    def causes(self) -> list[str]:
        """The causes that a refusal names, without numbers, places and names."""
        error = self.record["error"]
        # Where the lattice folds, a check fails, and the hint says why.
        text = FOLDED if FOLDED in (error["hint"] or "") else error["message"]
        text = re.sub(r"[,;]? (the first )?(near|at) \([^)]*\)", "", text)
        text = re.sub(r"'[^']*'|\"[^\"]*\"|`[^`]*`", "'...'", text)
        for kind in FAULTS:
            text = text.replace(kind.one, kind.several)
        text = re.sub(r"[-+]?\d[\d.,]*(e[-+]?\d+)?(?<![.,])", "N", text)
        parts = [re.sub("^N ", "", part) for part in text.split("; ")]
        where = "" if error["file"] in (self.model, None) else "of a file that it names: "
        return [where + part for part in parts if not part.startswith("such ")]


def table(corpus: Corpus, runs: list[Run], timeout: float) -> Iterator[str]:
    """The lines of the table: outcomes, causes, what went wrong, what took longest, CAD parts."""
    left_out = [f"{why}: {count:,}" for why, count in sorted(corpus.left_out.items()) if count]
    parts = sum(cad_format(model) is not None for model in corpus.models)
    yield (
        f"Mesh files: {len(corpus.models) - parts:,}, CAD files: {parts:,}. "
        f"Not run: {', '.join(left_out) or 'none'}."
    )
    yield f"Too slow: more than {timeout:g} s."
    yield from outcomes(runs)
    yield from causes([run for run in runs if run.outcome == REFUSED])
    yield from others([run for run in runs if run.outcome not in (MADE, REPAIRED, REFUSED)])
    made = [run for run in runs if "report" in run.record]
    yield from slowest([run for run in made if run.kind == MESHES])
    yield from cad_parts([run for run in made if "part" in run.record["report"]])


def outcomes(runs: list[Run]) -> Iterator[str]:
    """How many runs ended how."""
    yield from ("", *head("", "degree", "run", *OUTCOMES))
    counts = Counter((run.kind, run.degree, run.outcome) for run in runs)
    shown = {(kind == PARTS, degree, kind) for kind, degree, _ in counts}
    for _, degree, kind in sorted(shown):
        numbers = [counts[kind, degree, what] for what in OUTCOMES]
        yield line(kind, degree, *(f"{number:,}" for number in (sum(numbers), *numbers)))


def causes(refused: Iterable[Run]) -> Iterator[str]:
    """How often each cause was named."""
    found: dict[str, Counter[int]] = defaultdict(Counter)
    example: dict[str, str] = {}
    for run in refused:
        for each in run.causes:
            found[each][run.degree] += 1
            example.setdefault(each, run.where)
    degrees = sorted({degree for counts in found.values() for degree in counts})
    yield from ("", "Causes of refusals; a file that has several counts for each.", "")
    yield from head("cause", *(f"degree {degree}" for degree in degrees), "for example")
    for each in sorted(found, key=lambda each: (-found[each].total(), each)):
        yield line(each, *(found[each][degree] for degree in degrees), example[each])


def others(runs: list[Run]) -> Iterator[str]:
    """What was neither made nor refused."""
    if runs:
        yield from ("", "Everything else that was not made.", "")
        yield from head("file", "degree", "outcome", "message")
    for run in runs:
        yield line(run.where, run.degree, run.outcome, run.message)


def slowest(made: list[Run]) -> Iterator[str]:
    """The meshes that took longest."""
    yield from ("", "The slowest meshes.", "")
    yield from head("file", "degree", "polygons", "faces", "seconds, verification included")
    for run in sorted(made, key=lambda run: -run.record["seconds"])[:SLOWEST]:
        report = run.record["report"]
        sizes = (f"{report['mesh']['polygons']:,}", f"{report['faces']:,}")
        yield line(run.where, run.degree, *sizes, f"{run.record['seconds']:.0f}")


def cad_parts(made: list[Run]) -> Iterator[str]:
    """What became of each CAD part with curved faces."""
    if made:
        yield from ("", "CAD parts with curved faces.", "")
        yield from head(
            *("part", "degree", "faces by kind", "valid as read", "valid as written"),
            *("exact", "fitted", "control points", "largest deviation", "allowed", "seconds"),
        )
    for run in sorted(made, key=lambda run: (run.name, run.degree)):
        report, found = run.record["report"], run.record["verification"]
        kinds = ", ".join(f"{many} {kind}" for kind, many in report["part"]["faces"].items())
        yield line(
            *(run.where, run.degree, kinds, yes(report["part"]["valid"]), yes(found["valid"])),
            *(report["faces_by"]["exact"], report["faces_by"]["fitted"]),
            f"{report['control_points']:,}",
            *(length(found[name], report["unit"]) for name in ("max_deviation", "tolerance")),
            f"{run.record['seconds']:.0f}",
        )


def length(value: float | None, unit: str) -> str:
    """A length that was measured; some files have nothing to measure."""
    return "-" if value is None else f"{value:.1e} {unit}"


def yes(answer: bool) -> str:
    """Yes or no."""
    return "yes" if answer else "no"


def head(*names: object) -> tuple[str, str]:
    """The head of a table."""
    return line(*names), line(*["---"] * len(names))


def line(*values: object) -> str:
    """A line of a table."""
    return "| " + " | ".join(printable(str(value)).replace("|", "\\|") for value in values) + " |"
