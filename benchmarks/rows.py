"""The rows of the table, each a function of the size and a folder for its files."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cases
import numpy as np
import rows_edits
import rows_fields
import rows_scale
from measure import FFD, Row, child, in_turn, run_process


@dataclass(frozen=True)
class Size:
    """How much is done.

    Parameters
    ----------
    name : str
    frequency : int
        The sphere of most rows has 20 times its square facets.
    large : int
        The frequency of the sphere for growth.
    patches, rounds, jobs : int
    """

    name: str
    frequency: int
    large: int
    patches: int
    rounds: int
    jobs: int


SIZES = {
    "full": Size("full", frequency=16, large=50, patches=5000, rounds=5, jobs=40),
    "small": Size("small", frequency=3, large=5, patches=100, rounds=1, jobs=2),
}


def patches(size: Size, folder: Path) -> Iterator[Row]:
    """Control points of tricubic patches: all at once, and by splinepy one after the other."""
    import splinepy

    from ffdcli.mesh import read_mesh
    from ffdcli.pipeline import prepare, read_lattice

    mesh = read_mesh(cases.sphere_files(folder, size.frequency)[0])
    lattice = read_lattice(cases.LATTICE, mesh)
    geometry = prepare(mesh, lattice, patches="bezier").geometry
    net = lattice.volume.net
    general = [batch for batch in geometry.patches if all(batch.sloping)]
    ours, theirs, done, worst = 0.0, 0.0, 0, 0.0
    for batch in general:
        chosen = np.arange(min(len(batch.patches), size.patches - done))
        if not len(chosen):
            break
        done += len(chosen)
        times = []
        for _ in range(size.rounds):
            begun = time.perf_counter()
            found = batch.control_points(net, chosen)
            times.append(time.perf_counter() - begun)
        ours += statistics.median(times)
        # The volume's polynomial over a box round each patch, and the patch's corners in it.
        a, b, c = batch.order
        outer = batch.restriction.apply(net, chosen).reshape(len(chosen), -1, 3, order="C")
        for row in chosen.tolist():
            corners = np.zeros((4, 3))
            for number, (j, i) in enumerate(np.ndindex(2, 2)):
                corners[number, [a, b, c]] = batch.share[row, i, j], i, j
            # splinepy's first parameter runs fastest.
            points = outer[row].reshape(4, 4, 4, 3).transpose(2, 1, 0, 3).reshape(-1, 3)
            volume_piece = splinepy.Bezier(degrees=[3, 3, 3], control_points=points)
            plane = splinepy.Bezier(degrees=[1, 1], control_points=corners)
            begun = time.perf_counter()
            composed = volume_piece.compose(plane)
            theirs += time.perf_counter() - begun
            if row < 10:
                at = np.random.default_rng(row).random((5, 2))
                mine = splinepy.Bezier(
                    degrees=batch.degrees,
                    control_points=found[row].transpose(1, 0, 2).reshape(-1, 3),
                )
                worst = max(worst, np.abs(mine.evaluate(at) - composed.evaluate(at)).max())
    ratio = theirs / ours
    yield Row(
        f"control points of {done:,} tricubic patches",
        "splinepy `Bezier.compose`, patch by patch",
        f"{ratio:.0f}× faster ({1e6 * ours / done:.0f} µs a patch); they agree to {worst:.0e}",
        "20× faster",
        ratio >= 20 and worst < 1e-12,
    )


def whole(size: Size, folder: Path) -> Iterator[Row]:
    """`ffd deform` against the floor; from mesh to shape against a read; a kept plan."""
    mesh, lattice = cases.sphere_files(folder, size.frequency)
    facets = 20 * size.frequency**2
    made = run_process(
        child("shape", mesh, lattice, folder / "shape.bin", max(size.rounds, 2)), folder
    ).value
    command = [*FFD, "deform", mesh, lattice, "-o", "ours.step", "--quiet"]
    written = ["-o", "direct.step", "--writer", "direct"]
    bottom, *ways = in_turn(
        size.rounds,
        lambda: run_process(child("floor", folder / "shape.bin", folder / "floor.step"), folder),
        lambda: run_process([*command, "--no-check"], folder),
        lambda: run_process(command, folder),
        lambda: run_process([*command, *written], folder),
        lambda: run_process([*FFD, "verify", "ours.step", mesh, lattice, "--quiet"], folder),
    )
    floor, (unchecked, checked, direct, _) = bottom.seconds, (way.seconds for way in ways)
    what, against = f"`ffd deform`, sphere of {facets:,} facets, exact", "OpenCascade's STEP alone"
    for name, seconds, wanted in (("--no-check", unchecked, 1.25), ("with checks", checked, 1.6)):
        yield Row(
            f"{what}, {name}",
            f"{against} ({floor:.1f} s)",
            f"{seconds / floor:.2f}× ({seconds:.1f} s)",
            f"at most {wanted}×",
            seconds <= wanted * floor,
        )
    spent, least, verified = ways[2].processor, bottom.processor, ways[3]
    share = (folder / "direct.step").stat().st_size / (folder / "ours.step").stat().st_size
    yield Row(
        f"{what}, `--writer direct`, own check on",
        f"{against} ({floor:.1f} s; {least:.1f} s of processors)",
        f"{direct / floor:.2f}× ({direct:.1f} s); processors {spent / least:.2f}× ({spent:.1f} s);"
        f" {share:.2f}× the bytes of `--writer kernel`",
        "at most 0.4× in both, no more bytes",
        max(direct / floor, spent / least) <= 0.4 and share <= 1,
    )
    yield Row(
        f"`ffd verify` of that file of `--writer kernel`, {facets:,} faces",
        f"{against} ({least:.1f} s of processors)",
        f"processors {verified.processor / least:.2f}× ({verified.processor:.1f} s)",
        "at most 1.5×",
        verified.processor <= 1.5 * least,
    )
    ratio = made["ours"] / made["read"]
    yield Row(
        "the same, from mesh to finished OpenCascade shape",
        f"OpenCascade's binary read of it ({made['read']:.2f} s)",
        f"{ratio:.1f}× ({made['ours']:.2f} s)",
        "at most 4×",
        ratio <= 4,
    )
    first = f"first deform ({made['first']:.2f} s)"
    yield Row(
        "the same deformed again with a kept plan, geometry only",
        first,
        f"{made['first'] / made['again']:.1f}× faster ({made['again']:.2f} s)",
        "-",
        None,
    )
    ratio = made["first"] / made["kept"]
    yield Row(
        "the same with the plan's matrices",
        first,
        f"{ratio:.1f}× faster ({made['kept']:.3f} s); "
        f"once {made['matrices']:.1f} s and {made['bytes'] / 1e6:.0f} MB for them",
        "5× faster",
        ratio >= 5,
    )


def growth(size: Size, folder: Path) -> Iterator[Row]:
    """Time and memory per facet of our own stages, and of OpenCascade's, at ten times the size."""
    measured = []
    for frequency in (size.frequency, size.large):
        mesh, lattice = cases.sphere_files(folder, frequency)
        rounds = [
            run_process(
                child("stages", mesh, lattice, folder / "big.step", "yes" if last else "no"),
                folder,
            ).value
            for last in [False] * (size.rounds // 2) + [True]
        ]
        own = {name: statistics.median(one[name] for one in rounds) for name in ("seconds", "peak")}
        kernel = {name: rounds[-1][f"kernel_{name}"] for name in ("seconds", "peak")}
        measured.append(
            [{k: v / (20 * frequency**2) for k, v in one.items()} for one in (own, kernel)]
        )
    small, large = measured
    what = f"{20 * size.large**2:,} facets"
    against = f"{20 * size.frequency**2:,} facets"
    for who, index in (("our own stages", 0), ("OpenCascade's build and write", 1)):
        time_ratio = large[index]["seconds"] / small[index]["seconds"]
        memory_ratio = large[index]["peak"] / small[index]["peak"]
        ours = index == 0
        yield Row(
            f"{what}: {who}, per facet",
            against,
            f"time {time_ratio:.2f}× ({1e3 * large[index]['seconds']:.2f} ms), "
            f"peak memory {memory_ratio:.2f}× ({large[index]['peak'] / 1e3:.0f} kB)",
            "time at most 1.15×, memory not growing" if ours else "-",
            (time_ratio <= 1.15 and memory_ratio <= 1.0) if ours else None,
        )


def faceted(size: Size, folder: Path) -> Iterator[Row]:
    """A box, exact, against facets fine enough, written as STEP."""
    mesh = cases.write_obj(folder / "box.obj", *cases.box_mesh())
    lattice = cases.write_lattice(folder / "box.yaml", [3, 3, 3], [6, 6, 6], cases.BOX)
    limit = 5e-4 if size.name == "full" else 2e-2
    facets = run_process(child("faceted", mesh, lattice, folder / "facets.step", limit), folder)
    rounds = max(1, size.rounds)
    command = [*FFD, "deform", mesh, lattice, "-o", "box.step", "--quiet"]
    exact = statistics.median(run_process(command, folder).seconds for _ in range(rounds))
    smaller = (folder / "facets.step").stat().st_size / (folder / "box.step").stat().st_size
    faster = facets.seconds / exact
    count, deviation = facets.value["facets"], facets.value["deviation"]
    full = size.name == "full"
    yield Row(
        "box 100×60×40, tricubic 6×6×6, exact",
        f"{count:,} facets, off by {deviation:.1e} × size, as STEP ({facets.seconds:.0f} s)",
        f"{smaller:,.0f}× smaller, {faster:.0f}× faster ({exact:.1f} s)",
        "1,000× smaller, 15× faster",
        smaller >= 1000 and faster >= 15 if full else None,
    )


# Degrees, lattice, triangles, and the paper's counts: sub-polygons and patches of the method
# before it, and of its own (Feng 2002, Table 2).
TABLE_2 = (
    (7, (2, 2, 2), (4, 4, 4), 12, (60, 60), (36, 24)),
    (8, (2, 2, 1), (4, 4, 2), 56, (142, 142), (96, 47)),
    (9, (2, 2, 1), (5, 5, 2), 200, (518, 518), (344, 157)),
    (10, (2, 2, 2), (6, 8, 6), 260, (1436, 1636), (840, 318)),
    (11, (2, 2, 2), (6, 9, 3), 178, (814, 814), (438, 194)),
    (12, (2, 2, 2), (6, 5, 6), 96, (840, 840), (390, 207)),
    (13, (2, 2, 2), (7, 3, 6), 956, (1980, 1980), (1424, 1154)),
)
# Figures whose objects have few planes parallel to the lattice's axes.
TILTED = (12, 13)


def poles(size: Size, folder: Path) -> Iterator[Row]:
    """A box as CAD, its poles moved as PyGeM does, and ours, against the true deformation."""
    mesh = cases.write_obj(folder / "box.obj", *cases.box_mesh())
    lattice = cases.write_lattice(folder / "box.yaml", [3, 3, 3], [6, 6, 6], cases.BOX)
    run_process(child("box", folder / "box.bin"), folder)
    run_process([*FFD, "deform", mesh, lattice, "-o", "box.step", "--quiet"], folder)
    ours = run_process([*FFD, "verify", "box.step", mesh, lattice, "--json"], folder).value
    diagonal = float(np.linalg.norm(cases.BOX))
    exact = (
        f"ours: off by {ours['max_deviation'] / diagonal:.0e} × size, "
        f"{'valid' if ours['valid'] else 'not valid'}, "
        f"{'closed' if ours['watertight'] else 'not closed'}"
    )
    for knots in (10, 30, 100) if size.name == "full" else (10,):
        theirs = run_process(child("poles", folder / "box.bin", mesh, lattice, knots), folder).value
        yield Row(
            f"CAD's poles moved, {knots} knots inserted each way (as PyGeM does)",
            "the true deformation",
            f"faces off by {theirs['deviation']:.0e} × size, their outlines by "
            f"{theirs['boundary']:.0e}; {'valid' if theirs['valid'] else 'not valid'}, "
            f"{theirs['free']} edges do not join at 1e-6 × size; {exact}",
        )


# What `ffd deform` of a CAD part imports before it does anything.
START = ["-c", "import ffdcli.cli, ffdcli.part.result, OCP.STEPCAFControl, OCP.BinXCAFDrivers"]


def parts(size: Size, folder: Path) -> Iterator[Row]:
    """CAD parts: seconds beyond start-up, and their poles moved as PyGeM does beside ours."""
    columns, rows, inserted = (8, 7, (10, 30, 100)) if size.name == "full" else (2, 2, (10,))
    run_process(child("parts", columns, rows, "large.step", "small.step"), folder)
    lattice = folder / "part.yaml"
    lattice.write_text(
        "version: 1\ndegree: [3, 3, 3]\npoints: [8, 6, 5]\nedits:\n"
        "- bend: {axis: u, toward: w, angle: 70}\n- taper: {axis: u, factor: 0.8}\n"
    )
    # The second time all files are in memory.
    _, start = run_process(START, folder), run_process(START, folder)
    judged = {}
    for name, wanted in (("small", 3), ("large", 60)):
        command = ["deform", f"{name}.step", lattice, "-o", f"{name}-out.step", "--json"]
        run = run_process([*FFD, *command, "--report", f"{name}.json"], folder)
        checked = [f"{name}-out.step", f"{name}.step", lattice, "--against", f"{name}.json"]
        verdict = run_process([*FFD, "verify", *checked, "--json"], folder).value
        made, beyond = run.value, run.seconds - start.seconds
        judged[name] = made, verdict
        yield Row(
            f"`ffd deform` of a CAD part of {made['faces']:,} faces, within 1e-5 × size",
            f"start-up ({start.seconds:.1f} s)",
            f"{beyond:.1f} s more, {run.processor - start.processor:.1f} s of processors; "
            f"{made['control_points']:,} control points, {made['bytes'] / 1e6:.1f} MB; "
            f"{shape_of(verdict)}",
            f"at most {wanted} s",
            beyond <= wanted if size.name == "full" else None,
        )
    made, verdict = judged["small"]
    seconds = made["seconds"]["surfaces"] + made["seconds"]["build"]
    for knots in inserted:
        theirs = run_process(child("part_poles", "small.step", lattice, knots), folder).value
        yield Row(
            f"the small part's poles moved, {knots} knots inserted each way, trimming kept",
            "the true deformation",
            f"faces off by {theirs['deviation']:.0e} × size, gaps at edges of up to "
            f"{theirs['gap']:.0e}; {'valid' if theirs['valid'] else 'not valid'}, "
            f"{theirs['seconds']:.1f} s; ours: off by "
            f"{verdict['max_deviation'] / theirs['size']:.0e} × size, {shape_of(verdict)}, "
            f"{seconds:.1f} s",
        )


def shape_of(verdict: dict[str, Any]) -> str:
    """Whether a file is valid and closed."""
    valid = "valid" if verdict["valid"] else "not valid"
    return f"{valid}, {'closed' if verdict['watertight'] else 'not closed'}"


def large(size: Size, folder: Path) -> Iterator[Row]:
    """A sphere of 100,000 facets within a tolerance: does it finish, and in how much memory."""
    frequency = 71 if size.name == "full" else size.large
    mesh, lattice = cases.sphere_files(folder, frequency)
    command = [*FFD, "deform", mesh, lattice, "-o", "large.step", "--quiet", "--json", "--profile"]
    diagonal = float(np.linalg.norm(np.ptp(cases.geodesic_sphere(frequency)[0], axis=0)))
    run = run_process([*command, "--tolerance", f"{1e-6 * diagonal!r}"], folder)
    report = run.value
    peak = max(stage["peak_bytes"] + stage["kernel_peak_bytes"] for stage in report["profile"])
    yield Row(
        f"{20 * frequency**2:,} facets, --tolerance 1e-6 × size",
        "-",
        f"{report['bytes'] / 1e6:.0f} MB, {report['control_points']:,} control points, "
        f"{run.seconds:.0f} s, {peak / 2**30:.1f} GiB at most in both processes together",
        "within 8 GiB",
        peak <= 8 * 2**30,
    )


def million(size: Size, folder: Path) -> Iterator[Row]:
    """A million facets; see :func:`rows_scale.million`."""
    return rows_scale.million(size.name, folder)


def verified(size: Size, folder: Path) -> Iterator[Row]:
    """Files of 20,000 faces verified; see :func:`rows_scale.verified`."""
    return rows_scale.verified(size.name, folder)


def paper(size: Size, folder: Path) -> Iterator[Row]:
    """Meshes of the sizes in the paper's Table 2, by the schemes it compares and by ours."""
    from ffdcli.compare.table import compare_schemes
    from ffdcli.mesh import read_mesh
    from ffdcli.pipeline import read_lattice

    names = {
        "triangular": "triangular patches",
        "paper": "the paper's",
        "bezier": "ours, Bézier",
        "merged": "ours, merged",
    }
    for figure, degree, points, triangles, before, own in TABLE_2:
        places, faces = cases.prism(triangles) if triangles > 12 else cases.box_mesh()
        if figure in TILTED:
            places = places @ cases.TURN.T
        path = cases.write_obj(folder / f"figure-{figure}.obj", places, faces)
        extent = np.ptp(places, axis=0)
        lattice_file = cases.write_lattice(
            folder / f"figure-{figure}.yaml", list(degree), list(points), extent
        )
        mesh = read_mesh(path)
        lattice = read_lattice(lattice_file, mesh)
        runs = [compare_schemes(mesh, lattice) for _ in range(size.rounds)]
        found = [
            f"{names[row.scheme]} {row.sub_polygons:,} / {row.patches:,} / "
            f"{row.control_points:,} / "
            f"{1e3 * statistics.median(run[number].seconds for run in runs):.0f} ms"
            for number, row in enumerate(runs[0])
        ]
        yield Row(
            f"Fig. {figure}: {'×'.join(map(str, degree))}, {'×'.join(map(str, points))}, "
            f"{triangles} triangles; sub-polygons / patches / control points / time",
            f"Table 2, on other meshes: {before[0]} / {before[1]} before, {own[0]} / {own[1]} "
            "the paper's",
            "; ".join(found),
        )


def drags(size: Size, folder: Path) -> Iterator[Row]:
    """One drag of many constraints against the dense pseudo-inverse."""
    import drag

    constraints, per_axis = (100, 22) if size.name == "full" else (10, 8)
    found = drag.compare(constraints, per_axis)
    yield Row(
        f"drag, {per_axis**3:,} control points, {constraints} constraints",
        "dense pseudo-inverse (Hsu et al. 1992)",
        f"{found['ratio']:.0f}× faster ({1e3 * found['drag']:.1f} ms); "
        f"they agree to {found['difference']:.0e}",
    )


def fields(size: Size, folder: Path) -> Iterator[Row]:
    """A fit of a field, beside scipy's radial functions."""
    yield from rows_fields.fields(size.name, folder)


def edits(size: Size, folder: Path) -> Iterator[Row]:
    """Previews of edits by hand, one for each movement of a mouse."""
    yield from rows_edits.edits(size.name, folder)


def batches(size: Size, folder: Path) -> Iterator[Row]:
    """A sweep with two processes against one."""
    import batch_throughput

    rates = batch_throughput.measure(size.jobs, rounds=min(2, size.rounds), tell=False)
    yield Row(
        f"`ffd batch`, {size.jobs} jobs, two processes",
        f"one ({rates[1]:.2f} jobs/s)",
        f"{rates[2] / rates[1]:.2f}× ({rates[2]:.2f} jobs/s)",
    )


ROWS = {
    "patches": patches,
    "whole": whole,
    "growth": growth,
    "faceted": faceted,
    "poles": poles,
    "parts": parts,
    "large": large,
    "million": million,
    "verify": verified,
    "paper": paper,
    "drags": drags,
    "fields": fields,
    "edits": edits,
    "batches": batches,
}
