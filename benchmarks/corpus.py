"""The rate of a corpus: every mesh and CAD file of folders deformed, written, re-read and verified.

    python benchmarks/corpus.py FOLDER ... [--degrees 2,3] [-j N] [--work corpus-run]

The jobs are those of `ffd batch`, one for each file and degree: a B-spline lattice of 5 x 4 x 6
points twists and tapers the model, the STEP file is verified and then deleted, since thousands of
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
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

from corpus_table import Corpus, Run, table

from ffdcli.batch import Job, run_batch
from ffdcli.batch.events import Ended, Event
from ffdcli.batch.memory import default_workers
from ffdcli.brep.occ.formats import CAD_FORMATS, cad_format
from ffdcli.cli.batch_progress import show_batch
from ffdcli.mesh import read_mesh
from ffdcli.mesh.io.read import DECODERS
from ffdcli.messages import json_text

LATTICE = """\
version: 1
degree: [{degree}, {degree}, {degree}]
points: [5, 4, 6]
box: auto
edits:
  - twist: {{axis: w, angle: 35}}
  - taper: {{axis: u, factor: 0.7}}
"""
# Formats whose files refer to no others: equal bytes are equal models.
SELF_CONTAINED = (".stl", ".ply", ".off", ".3mf", ".glb", *CAD_FORMATS)
# A facet takes more bytes than this in every format, also packed.
BYTES_PER_FACET = 2
# Models that run before those of them that `--repair` may help run again.
PART = 600

Records = dict[str, dict[str, Any]]


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
    for first in range(0, 0 if options.table else len(corpus.models), PART):
        run(corpus.models[first : first + PART], degrees, options)
    text = "\n".join(table(corpus, ended(corpus, degrees, options.work), options.timeout))
    (options.work / "table.md").write_text(text + "\n", encoding="utf-8")
    print(text)


def limit_memory(gib: float) -> None:
    """Bound the address space of this process and of those that it starts."""
    with suppress(ImportError, ValueError):
        import resource

        limit = int(gib * 2**30)
        resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))


def find(folders: Iterable[str], largest: int, work: Path, workers: int) -> Corpus:
    """The model files of folders, without copies and without meshes of more than some facets."""
    left_out: Counter[str] = Counter()
    seen: set[tuple[str, str]] = set()
    sizes: dict[str, int] = {}
    names: dict[str, str] = {}
    for folder in map(os.path.abspath, folders):
        for path in sorted(walk(folder)):
            kind = os.path.splitext(path)[1].lower()
            if not (kind in DECODERS or kind in CAD_FORMATS) or path in names:
                continue
            with open(path, "rb") as stream:
                content = (hashlib.file_digest(stream, "sha256").hexdigest(), kind)
            if content in seen and kind in SELF_CONTAINED:
                left_out["equal to another byte by byte"] += 1
                continue
            seen.add(content)
            names[path] = os.path.relpath(path, os.path.dirname(folder))
            sizes[path] = os.path.getsize(path)
    models = sorted(names, key=lambda path: hashlib.sha256(os.fsencode(names[path])).digest())
    many = facets([path for path in models if may_exceed(path, sizes, largest)], work, workers)
    kept = [path for path in models if many.get(path, 0) <= largest]
    left_out[f"of more than {largest:,} facets"] = len(models) - len(kept)
    return Corpus(kept, names, dict(left_out))


def walk(folder: str) -> Iterator[str]:
    """All regular files in a folder."""
    for root, _, files in os.walk(folder):
        paths = (os.path.join(root, name) for name in files)
        yield from (path for path in paths if os.path.isfile(path))


def may_exceed(path: str, sizes: dict[str, int], largest: int) -> bool:
    """Whether a mesh may have more facets than some; those of .gltf may stand in other files."""
    if cad_format(path):
        return False
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


def run(models: list[str], degrees: list[int], options: argparse.Namespace) -> None:
    """Run the jobs of some models that have not ended, then those that `--repair` may help."""
    cases = [(model, degree) for model in models for degree in degrees]
    folder = os.path.abspath(options.work)
    for repair in (False, True):
        if repair:
            records = recorded(options.work)
            cases = [case for case in cases if repairable(records.get(output(*case)))]
        given = {"options": {"repair": True} if repair else {}, "verify": True}
        jobs = [
            Job(model, lattice_name(degree), output(model, degree, repair=repair), folder, **given)
            for model, degree in cases
        ]
        run_jobs(jobs, options)


def lattice_name(degree: int) -> str:
    """The lattice file of a degree, in the folder of the run."""
    return f"degree-{degree}.yaml"


def output(model: str, degree: int, *, repair: bool = False) -> str:
    """The name of the output of a model, which is the key of its record."""
    stem = re.sub(r"[^\w.-]", "_", Path(model).stem, flags=re.ASCII)[:60]
    key = hashlib.sha256(os.fsencode(model)).hexdigest()[:12]
    return f"{stem}-{key}-{degree}{'-repaired' if repair else ''}.step"


def run_jobs(jobs: list[Job], options: argparse.Namespace) -> None:
    """Run the jobs without a record, and with `--again` those that were not made."""
    records = recorded(options.work)
    done = ("verified",) if options.again else ("verified", "failed", "rejected")
    todo = [job for job in jobs if records.get(job.output, {}).get("status") not in done]
    with show_batch(quiet=False) as display:

        def forget(event: Event) -> None:
            display.show(event)
            if isinstance(event, Ended):
                Path(event.job.folder, event.job.output).unlink(missing_ok=True)

        run_batch(
            todo,
            options.work / "manifest.jsonl",
            workers=options.jobs,
            timeout=options.timeout,
            on_start=lambda jobs, _: display.start(jobs, 0),
            on_event=forget,
        )


def ended(corpus: Corpus, degrees: list[int], work: Path) -> list[Run]:
    """The runs that have ended; where `--repair` may help, the second one counts."""
    records, runs = recorded(work), []
    for degree, model in itertools.product(degrees, corpus.models):
        record = records.get(output(model, degree))
        if repairable(record):
            record = records.get(output(model, degree, repair=True))
        if record is not None:
            runs.append(Run(model, corpus.names[model], degree, record))
    return runs


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


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit("stopped; the same command goes on from here")
