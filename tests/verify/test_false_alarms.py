"""A campaign on random fitted and reduced results: right ones pass, corrupted ones fail.

A corruption must be found if a face moves, along its own normal and within its outline, by three
times the bound that the report states: the result is within the bound, so the face is then at least
twice the bound away from where it belongs. Whether it moves so far is measured on a dense grid.
"""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from ffdcli import deform
from ffdcli.brep.evaluate.lookup import model_of_brep
from ffdcli.brep.evaluate.trim import inside, outlines
from ffdcli.deformation import Deformation
from ffdcli.errors import FfdError
from ffdcli.verify import verify
from ffdcli.verify.direct import evaluate_directly
from ffdcli.verify.file import allowed_deviation, verify_file
from support.brep_models import without_last_face
from support.jobs import read_job

SEED = 20261128
# One in so many cases is judged from a file; the others are judged in memory.
WRITTEN = 10
GRID = np.stack(np.meshgrid(*2 * [np.linspace(0.01, 0.99, 40)]), axis=-1).reshape(-1, 2)


def random_mesh(random):
    """Vertices and polygons of a small closed body."""
    kind = random.integers(4)
    if kind == 0:
        body = trimesh.creation.box(random.uniform(0.5, 3, 3))
    elif kind == 1:
        body = trimesh.creation.cylinder(
            1.0, random.uniform(0.4, 3), sections=random.integers(3, 8)
        )
    elif kind == 2:
        outline = np.array([[0, 0], [2, 0], [2, 0.7], [0.8, 0.7], [0.8, 2], [0, 2]])
        sides = [(i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6) for i in range(6)]
        points = np.vstack(
            [np.column_stack([outline, np.full(6, z)]) for z in (0, random.uniform(0.3, 2))]
        )
        return points, [(5, 4, 3, 2, 1, 0), (6, 7, 8, 9, 10, 11), *sides]
    else:
        body = trimesh.creation.icosahedron()
        body = trimesh.convex.convex_hull(body.vertices * random.uniform(0.6, 1.4, (12, 1)))
    angle = random.uniform(0, 2 * np.pi)
    turn = trimesh.transformations.rotation_matrix(angle, random.normal(size=3))
    body.apply_transform(turn)
    return body.vertices, body.faces


def random_lattice(random, kind, size):
    """Text of a lattice file, and of another one whose first control point goes elsewhere."""
    edits = []
    strength = random.choice([0.08, 0.3]) * size
    if kind in ("bspline", "nurbs"):
        degree = random.integers(1, 4, 3)
        points = degree + 1 + random.integers(0, 3, 3)
        head = f"volume: {kind}\ndegree: {degree.tolist()}\npoints: {points.tolist()}\n"
        for _ in range(random.integers(1, 6)):
            at, by = random.integers(0, points).tolist(), random.normal(size=3) * strength
            edits.append(f"move: {{at: {at}, by: {by.tolist()}}}")
        if kind == "nurbs":
            at = random.integers(0, points).tolist()
            edits.append(f"weight: {{at: {at}, value: {random.uniform(0.4, 4)}}}")
    else:
        embedding = ", embedding: inverse" if kind == "inverse" else ""
        volume = "tspline" if kind == "inverse" else kind
        head = f"volume: {volume}\noctree: {{depth: {random.integers(1, 3)}{embedding}}}\n"
        for _ in range(random.integers(1, 4)):
            near, by = random.uniform(-size, size, 3) / 2, random.normal(size=3) * strength / 2
            edits.append(f"move: {{at: {{near: {near.tolist()}}}, by: {by.tolist()}}}")
    shift = (random.normal(size=3) * 0.1 * size).tolist()
    region = "{inside: {min: [-9, -9, -9], max: [9, 9, 9]}}"
    whole = f"transform: {{at: {region}, translate: {shift}}}"
    return tuple(
        head + "edits:\n" + "".join(f"  - {edit}\n" for edit in chosen)
        for chosen in (edits, [*edits, whole])
    )


def judge(brep, mesh, lattice, allowed, expected):
    deformation = evaluate_directly(Deformation.of(lattice, mesh.delta))
    return verify(
        model_of_brep(brep).read,
        True,
        mesh,
        deformation,
        allowed,
        expected_error=expected,
        agree=1e-2 * allowed / mesh.size if deformation.needs_fit else 1e-10,
    )


def with_a_pole_moved(brep, random, bound):
    """The record with one pole moved, so that its face moves by three bounds; None without any."""
    batches = np.array([len(batch.surfaces) for batch in brep.surfaces])
    if not len(batches):
        return None
    lines = outlines(model_of_brep(brep))
    for _ in range(20):
        number = random.choice(len(batches), p=batches / batches.sum())
        batch = brep.surfaces[number]
        row = random.integers(len(batch.surfaces))
        i, j = random.integers(batch.poles.shape[1]), random.integers(batch.poles.shape[2])
        face = int(np.flatnonzero(brep.face_surface == batch.surfaces[row])[0])
        model = model_of_brep(brep)
        low, high = model.domain[face]
        uv = low + GRID * (high - low)
        uv = uv[inside(lines, np.full(len(uv), face), uv)]
        before, tangents = model.on_faces(np.full(len(uv), face), uv)
        normal = np.cross(tangents[:, 0], tangents[:, 1])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)

        def moved(step, number=number, batch=batch, row=row, i=i, j=j):
            poles = batch.poles.copy()
            weight = poles[row, i, j, 3] if poles.shape[-1] == 4 else 1.0
            poles[row, i, j, :3] += weight * step
            surfaces = list(brep.surfaces)
            surfaces[number] = replace(batch, poles=poles)
            return replace(brep, surfaces=tuple(surfaces))

        way = normal.mean(axis=0) if len(uv) else np.zeros(3)
        if np.linalg.norm(way) < 0.1:
            continue
        way /= np.linalg.norm(way)
        after, _ = model_of_brep(moved(bound * way)).on_faces(np.full(len(uv), face), uv)
        motion = np.abs(((after - before) * normal).sum(axis=1)).max()
        # Poles that hardly move what the outline holds would have to go very far.
        if motion > 0.02 * bound:
            return moved(3 * bound * bound / motion * way)
    return None


def campaign(folder, count, seed):
    """Judge random cases, and say what came out."""
    random = np.random.default_rng(seed)
    counts, wrong = Counter(), []
    case = 0
    kinds = ["inverse", "bspline", "inverse", "nurbs", "hierarchical", "tspline"]
    while counts["right ones"] < count:
        case += 1
        kind = kinds[(case + seed) % 6]
        points, faces = random_mesh(random)
        size = float(np.linalg.norm(np.ptp(points, axis=0)))
        text, other = random_lattice(random, kind, size)
        tolerance = size * 10.0 ** random.uniform(-4, -1.7)
        option = "fit_tolerance" if kind == "inverse" else "tolerance"
        try:
            mesh, another = read_job(folder, other, points, faces)
            mesh, lattice = read_job(folder, text, points, faces)
            result = deform(mesh, lattice, **{option: tolerance})
        except FfdError as error:
            counts[f"refused: {type(error).__name__}"] += 1
            continue
        allowed = allowed_deviation(result.report, "report", mesh)
        expected = result.max_error
        counts[f"{kind}{' folded' if result.report['jacobian']['injective'] != 'yes' else ''}"] += 1
        if case % WRITTEN == 0:
            counts["from files"] += 1
            result.write(folder / "out.step")
            verdict = verify_file(
                folder / "out.step", mesh, lattice, tolerance=allowed, expected_error=expected
            )
        else:
            verdict = judge(result.brep, mesh, lattice, allowed, expected)
        counts["right ones"] += 1
        counts["right ones passed"] += verdict.passed
        if not verdict.passed:
            wrong.append((case, kind, verdict.reasons, verdict.undecided))
        corrupted = {"pole": (with_a_pole_moved(result.brep, random, allowed), lattice)}
        if case % 5 == 1:
            corrupted["other lattice"] = (result.brep, another)
        if case % 5 == 2:
            corrupted["face missing"] = (without_last_face(result.brep), lattice)
        for name, (brep, with_lattice) in corrupted.items():
            if brep is None:
                continue
            verdict = judge(brep, mesh, with_lattice, allowed, expected)
            counts[name] += 1
            counts[f"{name} failed"] += bool(verdict.reasons)
            if not verdict.reasons:
                deviation = verdict.max_deviation / allowed
                wrong.append((case, kind, name, f"{deviation:.3g} bounds", verdict.undecided))
    for name, number in sorted(counts.items()):
        print(f"{number:5d} {name}")
    return wrong


@pytest.mark.parametrize("part", [1, 4])
def test_a_random_result_is_judged_right(tmp_path, part):
    assert campaign(tmp_path, 1, SEED - part) == []


@pytest.mark.sweep
@pytest.mark.parametrize("part", range(5))
def test_a_few_random_results_are_judged_right(tmp_path, part):
    assert campaign(tmp_path, 2, SEED - part) == []


@pytest.mark.sweep
@pytest.mark.parametrize("part", range(20))
def test_many_random_results_are_judged_right(tmp_path, part):
    assert campaign(tmp_path, 16, SEED + 1 + part) == []
