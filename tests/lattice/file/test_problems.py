"""Every wrong lattice file is refused with its file, line and key."""

import re

import pytest

from ffdcli.errors import FileError, LatticeError
from ffdcli.lattice import load_lattice

V = "version: 1\n"
EDITS = V + "points: [4, 5, 6]\nedits:\n"  # the first edit is on line 4
MOVE = EDITS + "  - move: {at: %s, by: [0, 0, 1]}\n"
RATIONAL = V + "volume: nurbs\ndegree: [1, 1, 1]\npoints: [2, 2, 2]\nedits:\n"
DRAG = EDITS + "  - drag: {pairs: [{from: [0, 0, 0], by: [0, 0, 1]}], %s}\n"
LEFT = "[[0, 1, 0], [1, 0, 0], [0, 0, 1]]"
ROUGH = "[[0.7071, 0.7071, 0], [-0.7071, 0.7071, 0], [0, 0, 1]]"
FLAT = "[[1, 0, 0], [1, 0, 0], [0, 0, 1]]"
TURNED = V + "box: {center: [0, 0, 0], size: [1, 1, 1], axes: %s}\n"

# file, line, key, words of the message or hint
CASES = {
    "empty": ("", 1, None, "empty"),
    "comments only": ("# nothing\n", None, None, "empty"),
    "a list": ("- 1\n", 1, None, "keys such as"),
    "a word": ("lattice\n", 1, None, "keys such as"),
    "bad yaml": (V + "degree: [3, 3\nbox: auto\n", 3, None, "not valid YAML"),
    "tab": (V + "\tdegree: 3\n", 2, None, "not valid YAML"),
    "control character": (V + "unit: m\x01m\n", 2, None, "control character"),
    "two documents": (V + "---\nversion: 1\n", 2, None, "not valid YAML"),
    "python tag": (V + "unit: !!python/object:os.path x\n", 2, "unit", "tag"),
    "itself": (V + "degree: &a [*a]\n", 2, "degree[0]", "contains itself"),
    "duplicate key": (V + "degree: [3, 3, 3]\n\ndegree: [2, 2, 2]\n", 4, "degree", "line 2"),
    "duplicate nested": (
        EDITS + "  - twist:\n      axis: u\n      axis: v\n",
        6,
        "edits[0].twist.axis",
        "twice",
    ),
    "key no word": (V + "[1, 2]: 3\n", 2, None, "plain word"),
    "version missing": ("degree: [3, 3, 3]\n", 1, "version", "missing"),
    "version true": ("version: true\n", 1, "version", "must be 1"),
    "version 1.0": ("version: 1.0\n", 1, "version", "must be 1"),
    "version 2": ("\nversion: 2\n", 2, "version", "must be 1"),
    "misspelt": (V + "degre: [3, 3, 3]\n", 2, "degre", "did you mean `degree`"),
    "no such volume": (V + "volume: bezier\n", 2, "volume", "not `bezier`"),
    "volume without octree": (V + "volume: tspline\n", 2, "volume", "needs an octree"),
    "another embedding": (
        V + "volume: tspline\noctree: {embedding: reverse}\n",
        3,
        "octree.embedding",
        "must be displacement or inverse, not `reverse`",
    ),
    "cells of a file": (
        V + "volume: tspline\noctree: {cells: 5}\n",
        3,
        "octree.cells",
        "must be text, not `5`",
    ),
    "octree without its volume": (V + "octree: {depth: 3}\n", 2, "octree", "has no octree"),
    "lattices empty": (V + "lattices: []\n", 2, "lattices", "at least 1"),
    "lattices no list": (V + "lattices: {box: auto}\n", 2, "lattices", "must be a list"),
    "lattices of words": (V + "lattices: [auto]\n", 2, "lattices[0]", "mapping"),
    "beside lattices": (V + "degree: [3, 3, 3]\nlattices: [{}]\n", 2, "degree", "each entry"),
    "misspelt by lattices": (V + "lattices: [{}]\nunits: mm\n", 3, "units", "`unit`"),
    "version in a lattice": (V + "lattices:\n  - version: 1\n", 3, "lattices[0].version", "whole"),
    "unit in a lattice": (V + "lattices:\n  - {}\n  - unit: m\n", 4, "lattices[1].unit", "whole"),
    "lattices in a lattice": (
        V + "lattices:\n  - lattices: []\n",
        3,
        "lattices[0].lattices",
        "not a key",
    ),
    "type in a lattice": (
        V + "lattices:\n  - degree: [3, 3, x]\n",
        3,
        "lattices[0].degree[2]",
        "`x`",
    ),
    "sizes in a lattice": (
        V + "lattices:\n  - box: auto\n    points: [3, 6, 6]\n",
        4,
        "lattices[0].points[0]",
        "at least 4",
    ),
    "merge key": (V + "<<: {unit: mm}\n", 2, "<<", "not a key here"),
    "degree number": (V + "degree: 3\n", 2, "degree", "three whole numbers"),
    "degree length": (V + "degree: [3, 3]\n", 2, "degree", "not 2"),
    "degree true": (V + "degree:\n- 3\n- 3\n- true\n", 5, "degree[2]", "not true"),
    "degree quoted": (V + "degree: [3, '3', 3]\n", 2, "degree[1]", "quotes"),
    "degree half": (V + "degree: [3, 2.5, 3]\n", 2, "degree[1]", "whole number"),
    "degree 0": (V + "degree: [3, 3, 0]\n", 2, "degree[2]", "at least 1"),
    "degree sum": (V + "degree: [9, 8, 9]\n", 2, "degree", "add up to 26"),
    "points few": (V + "points: [4, 3, 4]\n", 2, "points[1]", "at least 4 control points"),
    "points many": (V + "points: [1000, 1000, 1000]\n", 2, "points", "10,000,000"),
    "points huge": (V + f"points: [4, 4, 1{'0' * 30}]\n", 2, "points", "10,000,000"),
    "digits": (V + f"points: [4, 4, 1{'0' * 5000}]\n", 2, "points[2]", "number"),
    "box word": (V + "box: automatic\n", 2, "box", "must be auto"),
    "box number": (V + "box: 3\n", 2, "box", "{min, max}"),
    "box no max": (V + "box: {min: [0, 0, 0]}\n", 2, "box.max", "missing"),
    "box nan": (V + "box: {min: [0, 0, .nan], max: [1, 1, 1]}\n", 2, "box.min[2]", "finite"),
    "box overflow": (V + "box: {min: [0, 0, 0], max: [1, 1, 1e999]}\n", 2, "box.max[2]", "finite"),
    "box inverted": (V + "box: {min: [0, 2, 0], max: [1, 1, 1]}\n", 2, "box.max[1]", "above 2"),
    "box flat": (V + "box: {center: [0, 0, 0], size: [1, 0, 1]}\n", 2, "box.size[1]", "greater"),
    "box spelling": (V + "box: {centre: [0, 0, 0], size: [1, 1, 1]}\n", 2, "box.centre", "center"),
    "axes rough": (TURNED % ROUGH, 2, "box.axes", "0.70710678118"),
    "axes left": (TURNED % LEFT, 2, "box.axes", "left-handed"),
    "axes dependent": (TURNED % FLAT, 2, "box.axes", "linearly dependent"),
    "axes two": (TURNED % "[[1, 0, 0], [0, 1, 0]]", 2, "box.axes", "three unit vectors, not 2"),
    "knots two lists": (V + "knots: [[], []]\n", 2, "knots", "three lists"),
    "knots null": (V + "knots: [[0.3, 0.6], [0.3, 0.6], null]\n", 2, "knots[2]", "list"),
    "knots count": (V + "knots:\n- []\n- [0.5]\n- []\n", 3, "knots[0]", "2 interior knots, not 0"),
    "knots outside": (
        V + "points: [5, 4, 4]\nknots: [[1], [], []]\n",
        3,
        "knots[0][0]",
        "between 0 and 1",
    ),
    "knots falling": (
        V + "points: [6, 4, 4]\nknots: [[0.5, 0.4], [], []]\n",
        3,
        "knots[0][1]",
        "lower than",
    ),
    "knots torn": (
        V + "degree: [1, 3, 3]\npoints: [4, 4, 4]\nknots: [[0.5, 0.5], [], []]\n",
        4,
        "knots[0][0]",
        "occurs 2 times",
    ),
    "ends": (V + "ends: open\n", 2, "ends", "clamped or unclamped"),
    "unit": (V + "unit: parsec\n", 2, "unit", "inch"),
    "border": (V + "border: c3\n", 2, "border", "c0, c1 or c2"),
    "border yes": (V + "border: true\n", 2, "border", "c0, c1, c2"),
    "border side": (V + "border: {u_min: c3}\n", 2, "border.u_min", "c0, c1 or c2"),
    "border no side": (V + "border: {x_min: c1}\n", 2, "border.x_min", "did you mean"),
    "edits word": (V + "edits: none\n", 2, "edits", "list"),
    "edit word": (EDITS + "  - twist\n", 4, "edits[0]", "one key, of"),
    "edit two keys": (
        EDITS + "  - twist: {axis: u, angle: 1}\n    bend: {}\n",
        4,
        "edits[0]",
        "one key",
    ),
    "edit unknown": (EDITS + "  - crump: {point: [0, 0, 0]}\n", 4, "edits[0].crump", "`crimp`"),
    "crimp without": (
        EDITS + "  - crimp: {point: [0, 0, 0]}\n",
        4,
        "edits[0].crimp.sharpness",
        "missing",
    ),
    "edit empty": (EDITS + "  - move:\n", 4, "edits[0].move", "nothing"),
    "at number": (MOVE % "3", 4, "edits[0].move.at", "three entries"),
    "at two": (MOVE % "[0, 0]", 4, "edits[0].move.at", "not 2"),
    "at range": (MOVE % "[4, 0, 0]", 4, "edits[0].move.at[0]", "out of range: there are 4 along u"),
    "at below": (MOVE % "[0, -6, 0]", 4, "edits[0].move.at[1]", "there are 5 along v"),
    "at in list": (MOVE % "[0, 0, [1, 6]]", 4, "edits[0].move.at[2][1]", "there are 6 along w"),
    "at huge": (MOVE % f"[0, 0, 1{'0' * 30}]", 4, "edits[0].move.at[2]", "out of range"),
    "at true": (MOVE % "[0, 0, true]", 4, "edits[0].move.at[2]", "an index"),
    "at float": (MOVE % "[0, 0, 1.0]", 4, "edits[0].move.at[2]", "an index"),
    "at list float": (MOVE % "[0, 0, [1.5]]", 4, "edits[0].move.at[2][0]", "whole number"),
    "at step": (MOVE % '["::2", 0, 0]', 4, "edits[0].move.at[0]", "slice like"),
    "at empty slice": (MOVE % '["2:2", 0, 0]', 4, "edits[0].move.at[0]", "selects none"),
    "at empty list": (MOVE % "[[], 0, 0]", 4, "edits[0].move.at[0]", "at least 1"),
    "at inside": (MOVE % "{inside: {min: [0, 0, 0]}}", 4, "edits[0].move.at.inside.max", "missing"),
    "at inside swapped": (
        MOVE % "{inside: {min: [0, 2, 0], max: [1, 1, 1]}}",
        4,
        "edits[0].move.at.inside.max[1]",
        "below min",
    ),
    "at near": (MOVE % "{near: [0, 0]}", 4, "edits[0].move.at.near", "three numbers"),
    "at level": (MOVE % "{near: [0, 0, 0], level: 1}", 4, "edits[0].move.at.level", "rows"),
    "move nowhere": (EDITS + "  - move: {at: [0, 0, 0]}\n", 4, "edits[0].move", "`by` or `to`"),
    "move both": (
        EDITS + "  - move: {at: [0, 0, 0], by: [0, 0, 1], to: [0, 0, 1]}\n",
        4,
        "edits[0].move",
        "both",
    ),
    "move many to": (
        EDITS + '  - move: {at: [":", 0, 0], to: [0, 0, 1]}\n',
        4,
        "edits[0].move.to",
        "selects 4",
    ),
    "transform idle": (
        EDITS + "  - transform: {at: [0, 0, 0], center: [0, 0, 0]}\n",
        4,
        "edits[0].transform",
        "does nothing",
    ),
    "rotate axis": (
        EDITS + "  - transform:\n      at: [0, 0, 0]\n      rotate: {axis: x, angle: 3}\n",
        6,
        "edits[0].transform.rotate.axis",
        "u, v or w",
    ),
    "twist without": (EDITS + "  - twist: {axis: u}\n", 4, "edits[0].twist.angle", "missing"),
    "twist infinite": (
        EDITS + "  - twist: {axis: u, angle: .inf}\n",
        4,
        "edits[0].twist.angle",
        "finite",
    ),
    "taper nothing": (
        EDITS + "  - taper: {axis: u, factor: 0}\n",
        4,
        "edits[0].taper.factor",
        "greater than 0",
    ),
    "bend itself": (
        EDITS + "  - bend: {axis: u, toward: u, angle: 9}\n",
        4,
        "edits[0].bend.toward",
        "itself",
    ),
    "move_knots count": (
        EDITS + "  - move_knots: {axis: w, values: [0.5]}\n",
        4,
        "edits[0].move_knots.values",
        "2 interior knots, not 1",
    ),
    "move_knots order": (
        EDITS + "  - move_knots:\n      axis: w\n      values:\n      - 0.5\n      - 0.25\n",
        8,
        "edits[0].move_knots.values[1]",
        "ascending",
    ),
    "net kind": (EDITS + "  - net: net.txt\n", 4, "edits[0].net", ".npy or .csv"),
    "net missing": (EDITS + "  - net: net.npy\n", 4, "edits[0].net", "no such file"),
    "net lists": (EDITS + "  - net: [[[[0, 0, 0]]]]\n", 4, "edits[0].net", "4 entries along u"),
    "net pair": (EDITS + "  - net: [[[[0, 0]]]]\n", 4, "edits[0].net[0][0][0]", "not 2"),
    "weight of bspline": (
        EDITS + "  - weight: {at: [0, 0, 0], value: 2}\n",
        4,
        "edits[0].weight",
        "volume: nurbs",
    ),
    "weight nothing": (
        RATIONAL + "  - weight: {at: [0, 0, 0], value: 0}\n",
        6,
        "edits[0].weight.value",
        "greater than 0, not `0`",
    ),
    "weight infinite": (
        RATIONAL + "  - weight: {at: [0, 0, 0], value: .inf}\n",
        6,
        "edits[0].weight.value",
        "finite",
    ),
    "weight at": (
        RATIONAL + "  - weight: {at: [0, 9, 0], value: 2}\n",
        6,
        "edits[0].weight.at[1]",
        "out of range",
    ),
    "weights of bspline": (EDITS + "  - weights: w.npy\n", 4, "edits[0].weights", "nurbs"),
    "weights kind": (RATIONAL + "  - weights: 3\n", 6, "edits[0].weights", ".npy or .csv"),
    "weights missing": (RATIONAL + "  - weights: w.npy\n", 6, "edits[0].weights", "no such file"),
    "weights shape": (
        RATIONAL + "  - weights: [[[1, 1], [1, 1]], [[1, 1]]]\n",
        6,
        "edits[0].weights[1]",
        "needs 2 entries along v",
    ),
    "weights few": (
        RATIONAL + "  - weights: [[[1, 1], [1, 1]], [[1, 1], [1]]]\n",
        6,
        "edits[0].weights[1][1]",
        "needs 2 weights along w, not 1",
    ),
    "weights negative": (
        RATIONAL + "  - weights: [[[1, 1], [1, 1]], [[1, 1], [1, -1]]]\n",
        6,
        "edits[0].weights[1][1][1]",
        "greater than 0, not -1",
    ),
    "drag empty": (EDITS + "  - drag: {pairs: []}\n", 4, "edits[0].drag.pairs", "at least 1"),
    "drag pairs": (EDITS + "  - drag: {pairs: 3}\n", 4, "edits[0].drag.pairs", "list of {from"),
    "drag nowhere": (
        EDITS + "  - drag: {pairs: [{from: [0, 0, 0]}]}\n",
        4,
        "edits[0].drag.pairs[0]",
        "`to` or `by`",
    ),
    "drag both": (
        EDITS
        + "  - drag:\n      pairs:\n"
        + "        - {from: [0, 0, 0], by: [0, 0, 1]}\n"
        + "        - {from: [0, 0, 0], to: [0, 0, 1], by: [0, 0, 1]}\n",
        7,
        "edits[0].drag.pairs[1]",
        "both",
    ),
    "drag from nothing": (
        EDITS + "  - drag: {pairs: [{to: [0, 0, 0]}]}\n",
        4,
        "edits[0].drag.pairs[0].from",
        "missing",
    ),
    "drag source": (
        EDITS + "  - drag: {pairs: [{source: [0, 0, 0], to: [0, 0, 0]}]}\n",
        4,
        "edits[0].drag.pairs[0].source",
        "keys here: from, to, by",
    ),
    "drag file kind": (EDITS + "  - drag: {pairs: p.txt}\n", 4, "edits[0].drag.pairs", ".csv"),
    "drag file missing": (
        EDITS + "  - drag: {pairs: p.csv}\n",
        4,
        "edits[0].drag.pairs",
        "no such file",
    ),
    "pin range": (DRAG % "pin: [[0, 0, 9]]", 4, "edits[0].drag.pin[0][2]", "out of range"),
    "pin alone": (DRAG % "pin: [0, 0, 0]", 4, "edits[0].drag.pin[0]", "three entries"),
    "hold kind": (DRAG % "hold: [{sphere: 3}]", 4, "edits[0].drag.hold[0]", "{group: name}"),
    "hold two": (
        DRAG % "hold: [{group: rim, point: [0, 0, 0]}]",
        4,
        "edits[0].drag.hold[0]",
        "has point and group",
    ),
    "hold rigid point": (
        DRAG % "hold: [{point: [0, 0, 0], rigid: true}]",
        4,
        "edits[0].drag.hold[0]",
        "no rigid motion",
    ),
    "hold swapped": (
        DRAG % "hold: [{inside: {min: [0, 0, 1], max: [1, 1, 0]}}]",
        4,
        "edits[0].drag.hold[0].inside.max[2]",
        "below min",
    ),
    "hold rigid word": (
        DRAG % "hold: [{group: rim, rigid: 1}]",
        4,
        "edits[0].drag.hold[0].rigid",
        "",
    ),
    "vary": (DRAG % "vary: knots", 4, "edits[0].drag.vary", "points or weights"),
    "vary of bspline": (DRAG % "vary: weights", 4, "edits[0].drag.vary", "volume: nurbs"),
    "vary least squares": (
        DRAG.replace(EDITS, RATIONAL) % "vary: weights, on_conflict: least_squares",
        6,
        "edits[0].drag.on_conflict",
        "vary: points",
    ),
    "vary rigid": (
        DRAG.replace(EDITS, RATIONAL) % "vary: weights, hold: [{group: rim, rigid: true}]",
        6,
        "edits[0].drag.hold[0].rigid",
        "rigid body",
    ),
    "on conflict": (DRAG % "on_conflict: warn", 4, "edits[0].drag.on_conflict", "least_squares"),
    "net shifted": (EDITS + "  - net: {origin: [0, 0, 0]}\n", 4, "edits[0].net.points", "missing"),
}


@pytest.mark.parametrize("name", CASES)
def test_is_refused_with_file_line_and_key(name, tmp_path):
    text, line, key, words = CASES[name]
    path = tmp_path / "lattice.yaml"
    path.write_text(text)
    with pytest.raises(LatticeError) as caught:
        load_lattice(path)
    error = caught.value
    assert error.file == str(path)
    assert error.key == key
    if line is not None:
        assert error.line == line
    assert words in f"{error.message} {error.hint}"
    assert "\n" not in str(error)
    assert not re.search(r"pydantic|box-by|entry-|edit-|at-indices", str(error))


def test_missing_file_and_folder_are_file_errors(tmp_path):
    for path in (tmp_path / "none.yaml", tmp_path):
        with pytest.raises(FileError) as caught:
            load_lattice(path)
        assert caught.value.file == str(path)
        assert isinstance(caught.value, OSError)


def test_text_that_is_not_utf8_is_refused_by_line(tmp_path):
    path = tmp_path / "lattice.yaml"
    path.write_bytes(b"version: 1\n# caf\xe9\n")
    with pytest.raises(LatticeError, match="UTF-8") as caught:
        load_lattice(path)
    assert caught.value.line == 2


def test_the_first_error_in_the_file_is_the_one_reported(tmp_path):
    path = tmp_path / "lattice.yaml"
    path.write_text("version: 1\nends: open\ndegree: [1, 2]\nunit: parsec\n")
    with pytest.raises(LatticeError) as caught:
        load_lattice(path)
    assert caught.value.line == 2


def test_a_whole_valid_file_of_the_contract_loads(tmp_path):
    path = tmp_path / "lattice.yaml"
    path.write_text(
        """\
version: 1
volume: bspline
degree: [3, 3, 3]
points: [6, 6, 6]
box: auto
knots: null
ends: clamped
unit: mm
border: c1
edits:
  - move:   {at: [3, 3, 5], by: [0, 0, 10]}
  - move:   {at: [0, 0, -1], to: [0, 0, 50]}
  - transform: {at: [":", ":", -1], scale: [1.2, 1.2, 1], rotate: {axis: w, angle: 30},
                translate: [0, 0, 5], center: [0, 0, 0]}
  - twist:  {axis: w, angle: 45}
  - taper:  {axis: w, factor: 0.5}
  - bend:   {axis: w, toward: u, angle: 60}
  - move_knots: {axis: u, values: [0.3, 0.6]}
  - move:   {at: [[0, 2], 1:3, ":"], by: [1e-3, 1E3, -.5]}
  - move:   {at: {inside: {min: [0, 0, 0], max: [1, 1, 1]}}, by: [0, 0, 1]}
  - move:   {at: {near: [0, 0, 0]}, to: [0, 0, 1]}
"""
    )
    spec = load_lattice(path).definitions[0].spec
    assert len(spec.edits) == 10
    assert spec.edits[7].move.by == (1e-3, 1e3, -0.5)
    assert spec.edits[7].move.at == ((0, 2), "1:3", ":")


def test_defaults(tmp_path):
    path = tmp_path / "lattice.yaml"
    path.write_text("version: 1\ndegree: [1, 2, 5]\nedits:\n")
    spec = load_lattice(path).definitions[0].spec
    assert spec.counts == (4, 5, 8)
    assert (spec.volume, spec.box, spec.ends, spec.border) == ("bspline", "auto", "clamped", "c1")
    assert spec.unit is None
    assert spec.edits == ()
