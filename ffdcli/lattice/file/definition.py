"""One lattice as a file defines it: its model, and the arrays and tables that it names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tokenize import TokenError
from typing import TYPE_CHECKING

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.fields.csv_field import read_csv
from ffdcli.fields.read import read_field
from ffdcli.fields.record import Field
from ffdcli.fields.table import bad_numbers, what_is_bad
from ffdcli.lattice.file.check_spec import MAX_POINTS
from ffdcli.lattice.file.drag_models import Drag, Pair
from ffdcli.lattice.file.edit_models import DragEdit, FitEdit, NetEdit, ShiftedNet, WeightsEdit
from ffdcli.lattice.file.fit_models import Fit
from ffdcli.lattice.file.source import KeyPath, Source
from ffdcli.lattice.file.spec import LatticeSpec
from ffdcli.lattice.file.tables import find_file, read_table, refused_at
from ffdcli.units import unit_named

if TYPE_CHECKING:
    from ffdcli.scan.record import Scan
    from ffdcli.volume.adaptive.tlattice import TLattice

# Largest number of pairs of a drag, and of pairs that a file lists itself.
MAX_PAIRS = 100_000
# Rows of a table of control points that are read before they are compared with the lattice.
_ROWS = 1000


@dataclass(frozen=True, eq=False)
class Definition:
    """One lattice of a file, checked, with the contents of the files that it names.

    Parameters
    ----------
    spec : LatticeSpec
        The keys of the file.
    source : Source
        File and lines of the keys, for messages.
    nets : mapping of int to (nu, nv, nw, 3) or (nu, nv, nw) float64
        Control points and weights of the `net` and `weights` edits, by the edit's number.
    pairs : mapping of int to PairTable
        Pairs of the `drag` and `fit` edits, by the edit's number; of a fit onto a scan those that
        were found.
    scans : mapping of int to Scan
        Targets of `fit` edits, by the edit's number, in model coordinates.
    cells : TLattice or None
        Cells that the file gives in place of an octree.
    """

    spec: LatticeSpec
    source: Source
    nets: Mapping[int, Floats]
    pairs: Mapping[int, PairTable]
    scans: Mapping[int, Scan]
    cells: TLattice | None

    @property
    def notes(self) -> tuple[str, ...]:
        """What the files of pairs hold besides them, with the edits that name the files."""
        return tuple(
            f"edits[{index}].{self.spec.edits[index].name}: {note}"
            for index, table in self.pairs.items()
            for note in table.notes
        )

    @property
    def finest(self) -> Floats:
        """(3,) smallest size of a cell along each axis, as a fraction of the box."""
        if self.cells is None:
            return np.full(3, 0.5**self.spec.deepest)
        return np.asarray((self.cells.high - self.cells.low).min(axis=0) / self.cells.counts)


def load_definition(spec: LatticeSpec, source: Source) -> Definition:
    """Read the files that a checked model names.

    Raises
    ------
    LatticeError
        A file is missing or does not hold what its key needs; names file and key.
    """
    nets, pairs = load_nets(spec, source), load_pairs(spec, source)
    cells = None
    if spec.octree is not None and spec.octree.cells is not None:
        from ffdcli.lattice.file.cells import load_cells

        cells = load_cells(spec.octree.cells, source)
    return Definition(spec, source, nets, pairs, load_scans(spec, source), cells)


def load_nets(spec: LatticeSpec, source: Source) -> dict[int, Floats]:
    """Control points (nu, nv, nw, 3) and weights (nu, nv, nw), by the number of the edit.

    The origin of a shifted net is not added.

    Raises
    ------
    LatticeError
        A file is missing, cannot be read, has another shape, or holds numbers that are not finite
        or weights that are not positive.
    """
    nets = {}
    counts = None if spec.adaptive else spec.counts
    for index, edit in enumerate(spec.edits):
        if isinstance(edit, NetEdit):
            path: KeyPath = ("edits", index, "net")
            points = edit.net
            if isinstance(points, ShiftedNet):
                path, points = (*path, "points"), points.points
            if isinstance(points, str):
                nets[index] = _read_net(points, counts, ("x", "y", "z"), path, source)
            else:
                nets[index] = np.array(points, dtype=np.float64)
        elif isinstance(edit, WeightsEdit):
            path = ("edits", index, "weights")
            weights = edit.weights
            if isinstance(weights, str):
                nets[index] = _read_net(weights, counts, ("weight",), path, source)
                _require_positive(nets[index], source.folder / weights, path, source)
            else:
                nets[index] = np.array(weights, dtype=np.float64)
    return nets


def _read_net(
    name: str,
    counts: tuple[int, ...] | None,
    columns: tuple[str, ...],
    path: KeyPath,
    source: Source,
) -> Floats:
    """An array (nu, nv, nw, columns), or (nu, nv, nw) for one column.

    On an octree (n, columns) or (n,), of any n.
    """
    file = find_file(name, path, source)
    npy = file.suffix.lower() == ".npy"
    if npy:
        raw = _read_npy(file, path, source)
    else:
        most = MAX_POINTS if counts is None else max(int(np.prod(counts)), _ROWS)
        _, raw = read_table(file, (columns,), path, source, most=most)
    counts = (len(raw),) if counts is None and raw.ndim else counts or ()
    wanted = counts if len(columns) == 1 else (*counts, len(columns))
    total = int(np.prod(counts))
    if not npy and len(raw) == total:
        raw = raw.reshape(wanted)
    if raw.shape != wanted:
        shape = f"{raw.shape}" if npy else f"{raw.shape[0]} rows"
        needs = f"{wanted}" if npy else f"{total} rows of {','.join(columns)}"
        hint = f"the lattice has {' × '.join(str(count) for count in counts)} control points"
        raise source.error(path, f"`{file}` holds {shape}; needed are {needs}", hint)
    # Numbers too large for float64 become infinite.
    with np.errstate(over="ignore"):
        net = np.array(raw, dtype=np.float64)
    bad = np.argwhere(bad_numbers(net.reshape(*counts, -1)).any(axis=-1))
    if len(bad):
        place = bad[0].tolist()
        message = f"`{file}` holds {what_is_bad(net[tuple(place)])}, at control point {place}"
        raise source.error(path, message, None)
    return net


def _read_npy(file: Path, path: KeyPath, source: Source) -> Floats:
    """The numbers of a .npy file, which stay in the file until they are copied.

    So a header that claims more than the file holds takes no memory.
    """
    try:
        raw = np.load(file, mmap_mode="r", allow_pickle=False)
    # numpy parses headers as Python: what is no header raises any of these.
    except (OSError, ValueError, EOFError, SyntaxError, TokenError, ArithmeticError, MemoryError):
        message = f"`{file}` cannot be read: it is not a .npy file of numbers, or not all of one"
        raise source.error(path, message, "write it with numpy.save") from None
    if not isinstance(raw, np.ndarray) or raw.dtype.kind not in "fiu":
        kind = getattr(raw, "dtype", "several arrays")
        raise source.error(path, f"`{file}` holds {kind}, not an array of real numbers", None)
    return raw


def _require_positive(weights: Floats, file: Path, path: KeyPath, source: Source) -> None:
    bad = np.argwhere(weights <= 0)
    if len(bad):
        value, place = float(weights[tuple(bad[0])]), bad[0].tolist()
        message = f"`{file}` holds the weight {value:g} at control point {place}"
        raise source.error(path, message, "weights must be greater than 0; 1 is the weight at rest")


@dataclass(frozen=True)
class PairTable:
    """Pairs of a drag or a fit, in model coordinates.

    Parameters
    ----------
    sources : (m, 3) float64
        Points of the undeformed object.
    goals : (m, 3) float64
        Targets of their images, or displacements.
    by : (m,) bool
        True for goals that are displacements.
    weights : (m,) float64
        Weight of each squared distance in a fit; a drag has none.
    notes : tuple of str
        What their file holds besides them, in words.
    """

    sources: Floats
    goals: Floats
    by: Bools
    weights: Floats
    notes: tuple[str, ...] = ()

    def take(self, rows: Bools) -> PairTable:
        """The pairs in ``rows`` (m,) alone."""
        return PairTable(self.sources[rows], self.goals[rows], self.by[rows], self.weights[rows])


def load_pairs(spec: LatticeSpec, source: Source) -> dict[int, PairTable]:
    """The pairs of all `drag` and `fit` edits, by the edit's number.

    Raises
    ------
    LatticeError
        A table is missing, cannot be read, or has a row that is not a pair; names the row.
    """
    tables = {}
    for index, edit in enumerate(spec.edits):
        path: KeyPath = ("edits", index, edit.name)
        if isinstance(edit, DragEdit):
            tables[index] = _drag_pairs(edit.drag, path, source)
        elif isinstance(edit, FitEdit) and edit.fit.pairs is not None:
            tables[index] = _fit_pairs(edit.fit, spec.unit, path, source)
    return tables


def load_scans(spec: LatticeSpec, source: Source) -> dict[int, Scan]:
    """The scans that `fit` edits name, by the edit's number, in the unit of the lattice.

    Raises
    ------
    LatticeError
        A scan is missing, cannot be read, or holds no surface.
    """
    scans = {}
    for index, edit in enumerate(spec.edits):
        if isinstance(edit, FitEdit) and edit.fit.target is not None:
            from ffdcli.scan.read import read_scan

            path: KeyPath = ("edits", index, edit.name, "target")
            file = find_file(edit.fit.target, path, source)
            with refused_at(path, source):
                scan = read_scan(file)
            scans[index] = scan.scaled(_factor(edit.fit.unit, spec.unit))
    return scans


def _factor(theirs: str | None, ours: str | None) -> float:
    """Length of a unit in another."""
    if theirs is None or ours is None or theirs == ours:
        return 1.0
    return unit_named(theirs).millimetres / unit_named(ours).millimetres


def _drag_pairs(drag: Drag, path: KeyPath, source: Source) -> PairTable:
    path = (*path, "pairs")
    if not isinstance(drag.pairs, str):
        return _listed_pairs(drag.pairs, path, source)
    file = find_file(drag.pairs, path, source)
    with refused_at(path, source):
        return _table(read_csv(file, weighted=False, most=MAX_PAIRS))


def _fit_pairs(fit: Fit, unit: str | None, path: KeyPath, source: Source) -> PairTable:
    """The pairs of a fit, in the unit of the lattice."""
    here = (*path, "pairs")
    if isinstance(fit.pairs, str):
        file = find_file(fit.pairs, here, source)
        targets = None
        if fit.targets is not None:
            targets = find_file(fit.targets, (*path, "targets"), source)
        with refused_at(here, source):
            table = _table(read_field(file, name=fit.field, targets=targets))
    else:
        table = _listed_pairs(fit.pairs or (), here, source)
    factor = _factor(fit.unit, unit)
    if factor == 1:
        return table
    return replace(table, sources=table.sources * factor, goals=table.goals * factor)


def _listed_pairs(pairs: tuple[Pair, ...], path: KeyPath, source: Source) -> PairTable:
    if len(pairs) > MAX_PAIRS:
        message = f"{len(pairs):,} pairs are more than the {MAX_PAIRS:,} that are allowed"
        raise source.error(path, message, "give fewer, or several drags")
    sources = np.array([pair.source for pair in pairs], dtype=np.float64)
    goals = [pair.to if pair.by is None else pair.by for pair in pairs]
    by = np.array([pair.by is not None for pair in pairs])
    return PairTable(sources, np.array(goals, dtype=np.float64), by, np.ones(len(by)))


def _table(field: Field) -> PairTable:
    by = np.full(len(field.sources), field.by)
    return PairTable(field.sources, field.goals, by, field.weights, field.notes)
