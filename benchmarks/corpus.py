"""The rate of a corpus: every mesh file of folders deformed, written, re-read and verified.

    python benchmarks/corpus.py FOLDER ... [--degrees 2,3] [-j N] [--work corpus-run]

The jobs are those of `ffd batch`, one for each file and degree: a B-spline lattice of 5 x 4 x 6
points twists and tapers the mesh, the STEP file is verified and then deleted, since thousands of
them need hundreds of gigabytes. Jobs that are refused with a hint at `--repair` run again with it.
The folder `--work` holds the manifest: a run that was stopped goes on where it was, `--again` runs
what was not made, `--table` prints the table of what has ended and runs nothing.
"""

import argparse
import hashlib
import itertools
import json
import os
import re
import signal
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ffdcli.batch import Job, run_batch
from ffdcli.batch.events import Ended, Event
from ffdcli.batch.memory import default_workers
from ffdcli.brep.occ.formats import CAD_FORMATS
from ffdcli.cli.batch_progress import show_batch
from ffdcli.mesh import read_mesh
from ffdcli.mesh.io.read import DECODERS
from ffdcli.mesh.soundness.fault_messages import FAULTS
from ffdcli.messages import json_text, printable

LATTICE = """\
version: 1
degree: [{degree}, {degree}, {degree}]
points: [5, 4, 6]
box: auto
edits:
  - twist: {{axis: w, angle: 35}}
  - taper: {{axis: u, factor: 0.7}}
"""
# Formats whose files refer to no others: equal bytes are equal meshes.
SELF_CONTAINED = (".stl", ".ply", ".off", ".3mf", ".glb")
# A facet takes more bytes than this in every format, also packed.
BYTES_PER_FACET = 2
MADE, REPAIRED, REFUSED, WRONG = "made and verified", "made with `--repair`", "refused", "wrong"
UNDECIDED, LATE, MEMORY = "undecided", "too slow", "out of memory"
OUTCOMES = (MADE, REPAIRED, REFUSED, WRONG, UNDECIDED, LATE, MEMORY)
# Errors that are no refusals, beside those that ask for a report.
FAILURES = ("internal", "kernel", "crash", "error")
FOLDED = "the lattice folds the model over"
SLOWEST = 5
# Meshes that run before those of them that `--repair` may help run again.
PART = 100

Records = dict[str, dict[str, Any]]


@dataclass(frozen=True)
class Corpus:
    """The files of some folders: meshes to run, and counts of those that are not run.

    Parameters
    ----------
    meshes : list of str
        Absolute paths, in an order by chance, so that those run first are a fair sample.
    names : dict of str to str
        Paths relative to the folders, for the table.
    left_out : dict of str to int
        Number of files by the reason why they are not run.
    """

    meshes: list[str]
    names: dict[str, str]
    left_out: dict[str, int]


def main() -> None:
    """Run what has not ended, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", nargs="+", metavar="FOLDER")
    parser.add_argument("--degrees", default="2,3", help="default: %(default)s")
    parser.add_argument("-j", "--jobs", type=int, default=default_workers(), help="processes")
    parser.add_argument("--work", type=Path, default=Path("corpus-run"), help="folder of the run")
    parser.add_argument("--timeout", type=float, default=120.0, help="seconds for each job")
    parser.add_argument("--memory", type=float, default=8.0, help="GiB for each process")
    parser.add_argument("--largest", type=int, default=20_000, help="facets; larger are left out")
    parser.add_argument("--again", action="store_true", help="run again what was not made")
    parser.add_argument("--table", action="store_true", help="run nothing, print the table")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    limit_memory(options.memory)
    corpus = find(options.folders, options.largest, options.work, options.jobs)
    degrees = [int(degree) for degree in options.degrees.split(",")]
    for degree in degrees:
        lattice = options.work / lattice_name(degree)
        lattice.write_text(LATTICE.format(degree=degree))
    for first in range(0, 0 if options.table else len(corpus.meshes), PART):
        run(corpus.meshes[first : first + PART], degrees, options)
    text = "\n".join(table(corpus, degrees, recorded(options.work), options.timeout))
    (options.work / "table.md").write_text(text + "\n", encoding="utf-8")
    print(text)


def limit_memory(gib: float) -> None:
    """Bound the address space of this process and of those that it starts."""
    with suppress(ImportError, ValueError):
        import resource

        limit = int(gib * 2**30)
        resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))


def find(folders: Iterable[str], largest: int, work: Path, workers: int) -> Corpus:
    """The mesh files of folders, without copies and without those of more than some facets."""
    left_out: Counter[str] = Counter()
    seen: set[tuple[str, str]] = set()
    sizes: dict[str, int] = {}
    names: dict[str, str] = {}
    for folder in map(os.path.abspath, folders):
        for path in sorted(walk(folder)):
            kind = os.path.splitext(path)[1].lower()
            if kind in CAD_FORMATS:
                left_out["CAD files"] += 1
            if kind not in DECODERS or path in names:
                continue
            with open(path, "rb") as stream:
                content = (hashlib.file_digest(stream, "sha256").hexdigest(), kind)
            if content in seen and kind in SELF_CONTAINED:
                left_out["equal to another byte by byte"] += 1
                continue
            seen.add(content)
            names[path] = os.path.relpath(path, os.path.dirname(folder))
            sizes[path] = os.path.getsize(path)
    meshes = sorted(names, key=lambda path: hashlib.sha256(os.fsencode(names[path])).digest())
    many = facets([path for path in meshes if may_exceed(path, sizes, largest)], work, workers)
    kept = [path for path in meshes if many.get(path, 0) <= largest]
    left_out[f"of more than {largest:,} facets"] = len(meshes) - len(kept)
    return Corpus(kept, names, dict(left_out))


def walk(folder: str) -> Iterator[str]:
    """All regular files in a folder."""
    for root, _, files in os.walk(folder):
        paths = (os.path.join(root, name) for name in files)
        yield from (path for path in paths if os.path.isfile(path))


def may_exceed(path: str, sizes: dict[str, int], largest: int) -> bool:
    """Whether a file may have more facets than some; those of .gltf may stand in other files."""
    return path.lower().endswith(".gltf") or sizes[path] > BYTES_PER_FACET * largest


def facets(paths: list[str], work: Path, workers: int) -> dict[str, int]:
    """Triangles of each mesh; counted once, and kept in the folder of the run."""
    kept = work / "facets.json"
    known: dict[str, int] = json.loads(kept.read_text("utf-8")) if kept.exists() else {}
    new = [path for path in paths if path not in known]
    with ProcessPoolExecutor(workers) as pool:
        known |= zip(new, pool.map(count_facets, new), strict=True)
    kept.write_text(json_text(known), encoding="utf-8")
    return known


def count_facets(path: str) -> int:
    """Triangles of a mesh; 0 if it cannot be read in a minute, of which its job will tell."""
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    signal.alarm(60)
    try:
        mesh = read_mesh(path)
        return len(mesh.corners) - 2 * mesh.polygon_count
    except (Exception, KeyboardInterrupt):
        return 0
    finally:
        signal.alarm(0)


def run(meshes: list[str], degrees: list[int], options: argparse.Namespace) -> None:
    """Run the jobs of some meshes that have not ended, then those that `--repair` may help."""
    cases = [(mesh, degree) for mesh in meshes for degree in degrees]
    folder = os.path.abspath(options.work)
    for repair in (False, True):
        if repair:
            records = recorded(options.work)
            cases = [case for case in cases if repairable(records.get(output(*case)))]
        given = {"options": {"repair": True} if repair else {}, "verify": True}
        jobs = [
            Job(mesh, lattice_name(degree), output(mesh, degree, repair=repair), folder, **given)
            for mesh, degree in cases
        ]
        run_jobs(jobs, options)


def lattice_name(degree: int) -> str:
    """The lattice file of a degree, in the folder of the run."""
    return f"degree-{degree}.yaml"


def output(mesh: str, degree: int, *, repair: bool = False) -> str:
    """The name of the output of a mesh, which is the key of its record."""
    stem = re.sub(r"[^\w.-]", "_", Path(mesh).stem, flags=re.ASCII)[:60]
    key = hashlib.sha256(os.fsencode(mesh)).hexdigest()[:12]
    return f"{stem}-{key}-{degree}{'-repaired' if repair else ''}.step"


def run_jobs(jobs: list[Job], options: argparse.Namespace) -> None:
    """Run the jobs without a record, and with `--again` those that were not made."""
    records = recorded(options.work)
    done = ("verified",) if options.again else ("verified", "failed", "rejected")
    todo = [job for job in jobs if records.get(job.output, {}).get("status") not in done]
    with show_batch(quiet=False) as display:

        def ended(event: Event) -> None:
            display.show(event)
            if isinstance(event, Ended):
                Path(event.job.folder, event.job.output).unlink(missing_ok=True)

        run_batch(
            todo,
            options.work / "manifest.jsonl",
            workers=options.jobs,
            timeout=options.timeout,
            on_start=lambda jobs, _: display.start(jobs, 0),
            on_event=ended,
        )


def recorded(work: Path) -> Records:
    """The last record of each output in the manifest."""
    records: Records = {}
    with suppress(FileNotFoundError), (work / "manifest.jsonl").open("rb") as lines:
        for line in lines:
            with suppress(ValueError):
                record = json.loads(line)
                records[record["output"]] = record
    return records


def repairable(record: dict[str, Any] | None) -> bool:
    """Whether a job was refused for faults that `--repair` repairs."""
    hint = (record or {}).get("error", {}).get("hint") or ""
    return "run again with --repair" in hint


def outcome(record: dict[str, Any]) -> str:
    """What became of a job."""
    error = record.get("error", {})
    if record["status"] == "verified":
        same = record["verification"]["watertight"] == record["report"]["mesh"]["closed"]
        found = REPAIRED if record["options"].get("repair") else MADE
        return found if same and record["verification"]["valid"] else WRONG
    if record["status"] == "rejected":
        return WRONG if record["verification"]["reasons"] else UNDECIDED
    if error["kind"] == "timeout":
        return LATE
    if re.search("not enough memory|out of memory|bad_alloc", error["message"]):
        return MEMORY
    asked = "please report it" in f"{error['message']} {error['hint']}"
    return WRONG if asked or error["kind"] in FAILURES else REFUSED


def cause(record: dict[str, Any], mesh: str) -> list[str]:
    """The causes that a refusal names, without numbers, places and names."""
    error = record["error"]
    # Where the lattice folds, a check fails, and the hint says why.
    text = FOLDED if FOLDED in (error["hint"] or "") else error["message"]
    text = re.sub(r"[,;]? (the first )?(near|at) \([^)]*\)", "", text)
    text = re.sub(r"'[^']*'|\"[^\"]*\"|`[^`]*`", "'...'", text)
    for kind in FAULTS:
        text = text.replace(kind.one, kind.several)
    text = re.sub(r"[-+]?\d[\d.,]*(e[-+]?\d+)?(?<![.,])", "N", text)
    parts = [re.sub("^N ", "", part) for part in text.split("; ")]
    where = "" if error["file"] in (mesh, None) else "of a file that it names: "
    return [where + part for part in parts if not part.startswith("such ")]


def table(corpus: Corpus, degrees: list[int], records: Records, timeout: float) -> Iterator[str]:
    """The lines of the table: outcomes, causes of refusals, what went wrong, what took longest."""
    ended: list[tuple[str, int, dict[str, Any], str]] = []
    found: dict[str, Counter[int]] = defaultdict(Counter)
    example: dict[str, str] = {}
    for degree, mesh in itertools.product(degrees, corpus.meshes):
        record = records.get(output(mesh, degree))
        if repairable(record):
            record = records.get(output(mesh, degree, repair=True))
        if record is None:
            continue
        name = short(corpus.names[mesh])
        ended.append((name, degree, record, outcome(record)))
        for each in cause(record, mesh) if outcome(record) == REFUSED else ():
            found[each][degree] += 1
            example.setdefault(each, name)
    left_out = [f"{why}: {count:,}" for why, count in sorted(corpus.left_out.items()) if count]
    yield f"Mesh files: {len(corpus.meshes):,}. Not run: {', '.join(left_out) or 'none'}."
    yield f"Too slow: more than {timeout:g} s."
    yield ""
    yield from rows("degree", "run", *OUTCOMES)
    counts = Counter((degree, what) for _, degree, _, what in ended)
    for degree in degrees:
        numbers = [counts[degree, what] for what in OUTCOMES]
        yield line(degree, *(f"{number:,}" for number in (sum(numbers), *numbers)))
    yield from ("", "Causes of refusals; a file that has several counts for each.", "")
    yield from rows("cause", *(f"degree {degree}" for degree in degrees), "for example")
    for each in sorted(found, key=lambda each: (-found[each].total(), each)):
        yield line(each, *(found[each][degree] for degree in degrees), example[each])
    others = [each for each in ended if each[3] not in (MADE, REPAIRED, REFUSED)]
    if others:
        yield from ("", "Everything else that was not made.", "")
        yield from rows("file", "degree", "outcome", "message")
    for name, degree, record, what in others:
        said = record.get("error", {}).get("message", "the file is not valid, or not closed")
        yield line(name, degree, what, said)
    yield from ("", "The slowest.", "")
    yield from rows("file", "degree", "polygons", "faces", "seconds, verification included")
    made = sorted((each for each in ended if "report" in each[2]), key=lambda e: -e[2]["seconds"])
    for name, degree, record, _ in made[:SLOWEST]:
        report = record["report"]
        sizes = (f"{report['mesh']['polygons']:,}", f"{report['faces']:,}")
        yield line(name, degree, *sizes, f"{record['seconds']:.0f}")


def short(name: str) -> str:
    """A path without its middle."""
    parts = name.split("/")
    return "/".join(parts if len(parts) < 6 else [*parts[:2], "...", *parts[-2:]])


def rows(*heads: object) -> tuple[str, str]:
    """The head of a table."""
    return line(*heads), line(*["---"] * len(heads))


def line(*values: object) -> str:
    """A line of a table."""
    return "| " + " | ".join(printable(str(value)).replace("|", "\\|") for value in values) + " |"


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit("stopped; the same command goes on from here")
