"""Lattice files with an octree: reading, selecting, editing, dragging, saving, refusing."""

import numpy as np
import pytest
import trimesh
import yaml

from ffdcli import read_lattice, read_mesh
from ffdcli.errors import LatticeError
from ffdcli.lattice import load_lattice, save_lattice, solved_text, steps_text
from ffdcli.volume.adaptive.volume import AdaptiveVolume
from support.jobs import ellipsoid
from support.places import SAMPLES


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    return ellipsoid(tmp_path_factory.mktemp("mesh"), 2)


def lattice_of(tmp_path, text, mesh=None, name="l.yaml"):
    path = tmp_path / name
    path.write_text("version: 1\n" + text)
    return read_lattice(path, mesh) if mesh is not None else load_lattice(path)


def refused(tmp_path, text, mesh=None):
    with pytest.raises(LatticeError) as caught:
        lattice_of(tmp_path, text, mesh)
    return f"{caught.value.key}: {caught.value}"


SPLINE = "volume: tspline\noctree: {depth: 3}\n"
LEVELS = "volume: hierarchical\noctree: {depth: 3}\n"


def test_at_rest_nothing_moves(tmp_path, mesh):
    for text in (SPLINE, LEVELS, LEVELS + "degree: [2, 1, 3]\n"):
        volume = lattice_of(tmp_path, text, mesh).volume
        assert isinstance(volume, AdaptiveVolume)
        assert np.array_equal(volume.evaluate(mesh.vertices), mesh.vertices)


def test_an_automatic_tspline_box_is_padded_by_a_finest_cell(tmp_path, mesh):
    for depth in (3, 4):
        volume = lattice_of(tmp_path, SPLINE.replace("3", str(depth)), mesh).volume
        assert np.allclose(volume.box[0], mesh.bounds[0] - volume.unit, rtol=0, atol=1e-12)
        assert np.allclose(volume.box[1], mesh.bounds[1] + volume.unit, rtol=0, atol=1e-12)
        assert len(volume.rest_points) < (2**depth + 1) ** 3


def test_regions_turn_with_the_mesh(tmp_path):
    turned = trimesh.creation.box([9.0, 4.0, 2.0])
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])
    turned.apply_transform(turn)
    turned.apply_translation([5, 6, 7])
    turned.export(tmp_path / "t.obj")
    mesh = read_mesh(tmp_path / "t.obj")
    for region in ("oriented", "minimum"):
        text = f"volume: hierarchical\noctree: {{depth: 2, region: {region}}}\n"
        lattice = lattice_of(tmp_path, text, mesh)
        layout = lattice.member.layout
        assert np.allclose(layout.box[1] - layout.box[0], [9, 4, 2], atol=1e-6)
        assert np.allclose(np.abs(layout.frame.axes @ turn[:3, :3]), np.eye(3), atol=1e-6)
        assert np.linalg.det(layout.frame.axes) > 0
        again = lattice_of(tmp_path, solved_text(lattice).split("\n", 2)[2], mesh, "again.yaml")
        assert np.allclose(again.points, lattice.points, rtol=0, atol=1e-13)


def test_selecting_by_number_place_and_level(tmp_path, mesh):
    at_rest = lattice_of(tmp_path, LEVELS, mesh)
    rest, level = at_rest.points, at_rest.volume.levels
    for selector, wanted in [
        ("{index: 5}", [5]),
        ("{index: [3, -1]}", [3, len(rest) - 1]),
        ('{index: "0:4"}', [0, 1, 2, 3]),
    ]:
        moved = lattice_of(
            tmp_path, LEVELS + f"edits: [{{move: {{at: {selector}, by: [0, 0, 1]}}}}]", mesh
        )
        assert np.flatnonzero((moved.points != rest).any(axis=1)).tolist() == wanted
    near = "edits: [{move: {at: {near: [9, 1, 0], level: 2}, by: [0, 0, 1]}}]"
    chosen = np.flatnonzero((lattice_of(tmp_path, LEVELS + near, mesh).points != rest).any(axis=1))
    distance = np.where(level == 2, np.linalg.norm(rest - [9, 1, 0], axis=1), np.inf)
    assert chosen.tolist() == [int(np.argmin(distance))]
    inside = (
        "edits: [{move: {at: {inside: {min: [0,-9,-9], max: [9,9,9]}, level: 3}, by: [0,0,1]}}]"
    )
    chosen = (lattice_of(tmp_path, LEVELS + inside, mesh).points != rest).any(axis=1)
    box = np.all((rest >= [0, -9, -9]) & (rest <= 9), axis=1)
    assert np.array_equal(chosen, box & (level == 3))


def test_hidden_control_points(tmp_path, mesh):
    at_rest = lattice_of(tmp_path, SPLINE, mesh)
    volume = at_rest.volume
    hidden = int(np.flatnonzero(volume.hidden)[0])
    edit = SPLINE + "edits: [{move: {at: %s, by: [0, 0, 1]}}]"
    said = refused(tmp_path, edit % f"{{index: {hidden}}}", mesh)
    assert "hidden" in said
    assert "edits[0].move.at.index" in said
    open_all = lattice_of(tmp_path, edit % f"{{index: {hidden}, hidden: true}}", mesh)
    assert (open_all.points != at_rest.points).any(axis=1).nonzero()[0].tolist() == [hidden]
    everywhere = "{inside: {min: [-99, -99, -99], max: [99, 99, 99]}%s}"
    exposed = lattice_of(tmp_path, edit % (everywhere % ""), mesh)
    assert np.array_equal((exposed.points != at_rest.points).any(axis=1), ~volume.hidden)
    every = lattice_of(tmp_path, edit % (everywhere % ", hidden: true"), mesh)
    assert (every.points != at_rest.points).any(axis=1).all()
    dragged = at_rest.drag([mesh.vertices[0]], [mesh.vertices[0] + 1])
    assert not (dragged.points != at_rest.points).any(axis=1)[volume.hidden].any()


@pytest.mark.parametrize("text", [SPLINE, LEVELS])
def test_drags_meet_their_targets_and_add_up(tmp_path, mesh, text):
    a, b = mesh.vertices[0], mesh.vertices[40]
    pairs = [f"{{from: {v.tolist()}, by: [0, 0.5, {n}]}}" for n, v in enumerate((a, b))]
    both = lattice_of(tmp_path, text + f"edits: [{{drag: {{pairs: [{', '.join(pairs)}]}}}}]", mesh)
    images = both.volume.evaluate(np.array([a, b]))
    assert np.abs(images - [a + [0, 0.5, 0], b + [0, 0.5, 1]]).max() < 1e-12 * mesh.size
    steps = lattice_of(tmp_path, steps_text(both).split("\n", 3)[3], mesh, "steps.yaml")
    assert np.abs(steps.points - both.points).max() < 1e-11
    to = both.drag([a], [a])
    assert np.abs(to.volume.evaluate(a[None]) - a).max() < 1e-12 * mesh.size


def test_a_level_cost_keeps_drags_coarse_and_moves_least(tmp_path, mesh):
    source = mesh.vertices[7]
    pair = f"{{from: {source.tolist()}, by: [0, 0, 1]}}"
    drag = f"edits: [{{drag: {{pairs: [{pair}], level_cost: %s}}}}]"
    shares = []
    for cost in (1.0, 4.0):
        lattice = lattice_of(tmp_path, LEVELS + drag % cost, mesh)
        volume = lattice.volume
        basis = volume.basis_matrix(source[None]).toarray()[0]
        # The least sum of cost^level |delta|^2 with basis . delta = 1, by Lagrange's rule.
        wanted = basis / cost**volume.levels
        wanted /= basis @ wanted
        moves = lattice.points - volume.rest_points
        assert np.abs(moves[:, 2] - wanted).max() < 1e-13
        assert np.abs(moves[:, :2]).max() == 0
        shares.append((moves[:, 2] * basis)[volume.levels == 0].sum())
    assert shares[1] > 1.5 * shares[0]


@pytest.mark.parametrize("text", [SPLINE, LEVELS])
def test_solved_files_read_back_to_the_last_bit(tmp_path, mesh, text):
    edits = "edits: [{move: {at: {near: [9, 1, 0]}, by: [0, 0, 1]}}"
    if text == SPLINE:
        edits += ", {weight: {at: {near: [9, 1, 0]}, value: 30}}"
    lattice = lattice_of(tmp_path, text + edits + "]", mesh)
    inline = tmp_path / "inline.yaml"
    inline.write_text(solved_text(lattice))
    save_lattice(lattice, tmp_path / "large.yaml")
    for path in (inline, tmp_path / "large.yaml"):
        again = read_lattice(path, mesh)
        assert np.array_equal(again.points, lattice.points)
        assert np.array_equal(again.weights, lattice.weights)
        assert np.array_equal(again.volume.net, lattice.volume.net)
    other = trimesh.creation.box([1, 2, 3])
    other.export(tmp_path / "other.obj")
    with pytest.raises(LatticeError, match="for this mesh there are"):
        read_lattice(inline, read_mesh(tmp_path / "other.obj"))


def test_scaling_runs_from_rest_to_edited(tmp_path, mesh):
    edits = "edits: [{weight: {at: {near: [9, 1, 0]}, value: 30}}]"
    lattice = lattice_of(tmp_path, SPLINE + edits, mesh)
    half, none = lattice.scaled(0.5), lattice.scaled(0)
    changed = np.flatnonzero(lattice.weights != none.weights)
    assert len(changed) == 1
    assert half.weights[changed].tolist() == [65.0]
    assert np.array_equal(none.volume.evaluate(mesh.vertices), mesh.vertices)


def test_a_crossed_side_is_locked_and_joins_smoothly(tmp_path, mesh):
    box = "box: {min: [-12, -9, -7], max: [2, 9, 7]}\n"
    at_rest = lattice_of(tmp_path, SPLINE + box, mesh)
    assert at_rest.crossed == ("u_max",)
    assert at_rest.locked.any()
    everything = "{inside: {min: [-99, -99, -99], max: [99, 99, 99]}}"
    said = refused(
        tmp_path, SPLINE + box + f"edits: [{{move: {{at: {everything}, by: [0, 0, 1]}}}}]", mesh
    )
    assert "locked" in said
    random = np.random.default_rng(0)
    shake = random.uniform(-1, 1, at_rest.points.shape) * ~at_rest.locked[:, None]
    volume = at_rest.member.with_control(at_rest.points + shake, at_rest.weights).volume
    seam = np.column_stack([np.full(50, 2.0), random.uniform([-9, -7], [9, 7], (50, 2))])
    assert np.abs(volume.evaluate(seam) - seam).max() < 1e-14
    assert np.abs(volume.jacobian(seam) - np.eye(3)).max() < 1e-12
    # The hierarchical field fades out by itself.
    assert not lattice_of(tmp_path, LEVELS + box, mesh).locked.any()


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("volume: tspline", "volume", "needs an octree"),
        ("octree: {depth: 3}", "octree", "has no octree"),
        (SPLINE + "points: [4, 4, 4]", "points", "from `octree`"),
        (LEVELS + "border: c0", "border", "from `octree`"),
        (SPLINE + "degree: [2, 2, 2]", "degree", "cubic"),
        (LEVELS + "degree: [9, 9, 9]", "degree", "25"),
        (SPLINE.replace("3}", "10}"), "octree.depth", "less than or equal to 9"),
        (SPLINE + "edits: [{twist: {axis: w, angle: 9}}]", "edits[0].twist", "rows"),
        (SPLINE + "edits: [{move: {at: [0, 0, 0], by: [0, 0, 1]}}]", "edits[0].move.at", "rows"),
        ("edits: [{move: {at: {near: [0,0,0], level: 1}, by: [0,0,1]}}]", "level", "no `level`"),
        ("edits: [{move: {at: {index: 1}, by: [0, 0, 1]}}]", "index", "no `index`"),
        (LEVELS + "edits: [{weight: {at: {index: 1}, value: 2}}]", "weight", "no weights"),
        (
            SPLINE + "edits: [{drag: {pairs: [{from: [0,0,0], by: [0,0,1]}], level_cost: 4}}]",
            "level_cost",
            "no levels",
        ),
        (
            LEVELS + "edits: [{drag: {pairs: [{from: [0,0,0], by: [0,0,1]}], vary: weights}}]",
            "vary",
            "has no weights",
        ),
        (
            SPLINE + "edits: [{drag: {pairs: [{from: [0,0,0], by: [0,0,1]}], vary: weights, "
            "on_conflict: least_squares}}]",
            "on_conflict",
            "least squares needs",
        ),
        (
            SPLINE + "edits: [{drag: {pairs: [{from: [0,0,0], by: [0,0,1]}], "
            "hold: [{inside: {min: [0,0,0], max: [1,1,1]}, rigid: true}]}}]",
            "hold[0].rigid",
            "use `volume: hierarchical`",
        ),
        (
            LEVELS + "edits: [{drag: {pairs: [{from: [0,0,0], by: [0,0,1]}], level_cost: 2, "
            "hold: [{inside: {min: [0,0,0], max: [1,1,1]}, rigid: true}]}}]",
            "level_cost",
            "cost the same",
        ),
        (
            SPLINE + "edits: [{net: [[[[0, 0, 0]]]]}]",
            "edits[0].net",
            "not nested as",
        ),
        (
            LEVELS.replace("3}", "2, also: [{min: [1, 0, 0], max: [0, 1, 1], depth: 3}]}"),
            "octree.also[0].max[0]",
            "greater than min",
        ),
        (
            SPLINE.replace("3}", "3, region: oriented}") + "box: {min: [0, 0, 0], max: [1, 1, 1]}",
            "octree.region",
            "computes the box",
        ),
    ],
)  # fmt: skip
def test_what_does_not_fit_together_is_refused(tmp_path, text, key, words):
    said = refused(tmp_path, text)
    assert key in said
    assert words in said


def test_what_only_the_mesh_can_tell_is_refused(tmp_path, mesh):
    edit = "edits: [{move: {at: {index: 99999}, by: [0, 0, 1]}}]"
    assert "out of range: there are" in refused(tmp_path, LEVELS + edit, mesh)
    far = "octree: {depth: 2, also: [{min: [50, 0, 0], max: [60, 1, 1], depth: 3}]}"
    assert "outside the lattice box" in refused(tmp_path, "volume: hierarchical\n" + far, mesh)
    several = (
        "lattices: [{volume: hierarchical, octree: {depth: 2}, box: {min: [-11, -9, -9], max: "
    )
    several += "[0, 9, 9]}}, {box: {min: [1, -9, -9], max: [11, 9, 9]}}]"
    assert "fades out beyond its box" in refused(tmp_path, several, mesh)
    with pytest.raises(LatticeError, match="its cells depend on it"):
        assert lattice_of(tmp_path, SPLINE).volume


def test_the_schema_knows_the_octree():
    from ffdcli.lattice import json_schema

    assert "octree" in json_schema()["properties"]
    text = SAMPLES / "octree" / "tree.yaml"
    assert yaml.safe_load(text.read_text())["volume"] == "tspline"
