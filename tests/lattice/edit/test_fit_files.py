"""The edit `fit`: files of its pairs, names of fields, units, and what is refused."""

import numpy as np
import pytest

from ffdcli import read_lattice, read_mesh
from ffdcli.errors import LatticeError
from support.field_files import FORMATS, MOVES, POINTS, npz, vtu
from support.jobs import obj
from support.mesh_models import CORNERS, QUADS

# Six numbers of each point, of a field that is affine: it is found whatever the lattice.
TURN = np.array([[1.1, 0.1, 0], [-0.1, 0.9, 0.05], [0, 0, 1.2]])
INSIDE = np.random.default_rng(5).uniform(0, 2, (40, 3))
IMAGES = INSIDE @ TURN.T + [0.5, 0, -0.25]


@pytest.fixture
def mesh(tmp_path):
    path = tmp_path / "cube.obj"
    path.write_text(obj(CORNERS * 2, QUADS))
    return read_mesh(path)


def load(folder, mesh, keys, **files):
    for name, content in files.items():
        name = name.replace("_", ".")
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    text = f"version: 1\nunit: mm\npoints: [4, 4, 4]\nedits:\n  - fit: {{{keys}}}\n"
    (folder / "l.yaml").write_text(text)
    return read_lattice(folder / "l.yaml", mesh)


def images(lattice, points):
    return lattice.maps[0].evaluate(points)


def csv(header, *columns):
    rows = np.column_stack(columns).tolist()
    return header + "".join(f"{','.join(map(repr, row))}\n" for row in rows)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("f.csv", csv("x,y,z,tx,ty,tz\n", INSIDE, IMAGES)),
        ("f.csv", csv("x,y,z,dx,dy,dz,weight\n", INSIDE, IMAGES - INSIDE, np.ones(40))),
        ("f.npz", npz(points=INSIDE, targets=IMAGES, weights=np.ones(40))),
    ],
)
def test_tables_and_arrays_are_fitted(tmp_path, mesh, name, content):
    lattice = load(tmp_path, mesh, f"pairs: {name}", **{name.replace(".", "_"): content})
    np.testing.assert_allclose(images(lattice, INSIDE), IMAGES, atol=1e-9)


def test_weights_count(tmp_path, mesh):
    """Two targets for one point: the image divides their distance by the weights."""
    points = np.vstack([INSIDE, INSIDE[:1], INSIDE[:1]])
    moves = np.zeros((42, 3))
    moves[41] = [0, 0, 0.2]
    weights = np.r_[np.full(40, 1e-9), 3, 1]
    content = npz(points=points, displacements=moves, weights=weights)
    keys = "pairs: f.npz, smooth: 1e-9, robust: false"
    lattice = load(tmp_path, mesh, keys, f_npz=content)
    moved = images(lattice, INSIDE[:1]) - INSIDE[:1]
    np.testing.assert_allclose(moved, [[0, 0, 0.05]], atol=1e-3)


def test_a_mesh_file_names_its_field_and_says_so(tmp_path, mesh):
    pytest.importorskip("meshio")
    # The nodes lie in the box.
    result = vtu([("U", MOVES / 100), ("V", MOVES)])
    lattice = load(tmp_path, mesh, "pairs: f.vtu, field: U, robust: false", f_vtu=result)
    assert lattice.fits[0].as_report()["pairs"] == 5
    lattice = load(tmp_path, mesh, "pairs: f.vtu", f_vtu=vtu([("U", MOVES / 100)]))
    assert "edits[0].fit: the field `U` of `f.vtu` is taken" in lattice.warnings


def test_a_second_mesh_gives_targets(tmp_path, mesh):
    pytest.importorskip("meshio")
    first, second = FORMATS["f.inp"]
    keys = "pairs: f.inp, targets: g.inp, scale: 0.01, robust: false"
    lattice = load(tmp_path, mesh, keys, f_inp=first, g_inp=second)
    found = lattice.fits[0]
    np.testing.assert_allclose(found.sources, POINTS)
    wanted = POINTS + MOVES * 0.01 - images(lattice, POINTS)
    np.testing.assert_allclose(np.abs(wanted), np.abs(found.left), atol=1e-9)


@pytest.mark.parametrize(("unit", "length"), [("m", 1000), ("inch", 25.4), ("mm", 1)])
def test_lengths_of_a_field_are_in_its_unit(tmp_path, mesh, unit, length):
    content = npz(points=INSIDE / length, targets=IMAGES / length)
    lattice = load(tmp_path, mesh, f"pairs: f.npz, unit: {unit}", f_npz=content)
    np.testing.assert_allclose(images(lattice, INSIDE), IMAGES, atol=1e-9)


def test_minus_the_field_compensates(tmp_path, mesh):
    content = npz(points=INSIDE, targets=IMAGES)
    lattice = load(tmp_path, mesh, "pairs: f.npz, scale: -1", f_npz=content)
    np.testing.assert_allclose(images(lattice, INSIDE), 2 * INSIDE - IMAGES, atol=1e-9)


@pytest.mark.parametrize(
    ("keys", "key", "words"),
    [
        ("pairs: f.step", "fit.pairs", "must name a .csv, .npz, .vtu"),
        ("pairs: 3", "fit.pairs", "must be a list of {from, to} or {from, by}, or a file name"),
        ("pairs: none.npz", "fit.pairs", "there is no such file"),
        ("pairs: bad.npz", "fit.pairs", "this is no .npz file"),
        ("pairs: bad.npz, field: U", "fit.pairs", "a field is named, and a .npz file has its own"),
        ("pairs: bad.inp, targets: none.inp", "fit.targets", "there is no such file"),
        ("pairs: [{from: [1, 1, 1], by: [0, 0, 1]}], field: U", "fit.field", "in a mesh file"),
        ("pairs: bad.npz, unit: furlong", "fit.unit", "must be"),
    ],
)
def test_what_is_wrong_is_refused_at_its_key(tmp_path, mesh, keys, key, words):
    with pytest.raises(LatticeError) as caught:
        load(tmp_path, mesh, keys, bad_npz="nothing", bad_inp="nothing")
    assert caught.value.key == f"edits[0].{key}"
    assert words in str(caught.value)


def test_a_unit_needs_that_of_the_lattice(tmp_path, mesh):
    (tmp_path / "l.yaml").write_text("version: 1\nedits:\n  - fit: {pairs: f.csv, unit: m}\n")
    with pytest.raises(LatticeError, match="add the key `unit` to the lattice file"):
        read_lattice(tmp_path / "l.yaml", mesh)


def test_the_line_of_a_file_is_named(tmp_path, mesh):
    pytest.importorskip("meshio")
    twice = FORMATS["f.inp"][0].replace(b"*Element", b"*Node\n99, 0., 0., 0.\n*Element")
    with pytest.raises(LatticeError, match=r"line \d+ of `.*f\.inp`: a second block \*NODE"):
        load(tmp_path, mesh, "pairs: f.inp, targets: f.inp", f_inp=twice)
