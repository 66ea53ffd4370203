"""Control nets kept in files: .npy, and .csv of x,y,z rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ffdcli.errors import LatticeError
from ffdcli.lattice.edit_models import NetEdit, ShiftedNet
from ffdcli.lattice.source import KeyPath, Source
from ffdcli.lattice.spec import LatticeSpec

Floats = NDArray[np.float64]


def load_nets(spec: LatticeSpec, source: Source) -> dict[int, Floats]:
    """The control nets (nu, nv, nw, 3) of all `net` edits, by the edit's number.

    Numbers are as written: a shifted net's origin is not added.

    Raises
    ------
    LatticeError
        A file is missing, unreadable, of another shape, or holds numbers that are not finite.
    """
    nets = {}
    for index, edit in enumerate(spec.edits):
        if isinstance(edit, NetEdit):
            path: KeyPath = ("edits", index, "net")
            points = edit.net
            if isinstance(points, ShiftedNet):
                path, points = (*path, "points"), points.points
            if isinstance(points, str):
                nets[index] = _read_net(points, spec.counts, path, source)
            else:
                nets[index] = np.array(points, dtype=np.float64)
    return nets


def _read_net(name: str, counts: tuple[int, int, int], path: KeyPath, source: Source) -> Floats:
    file = source.folder / name
    if not file.is_file():
        hint = "paths are relative to the lattice file"
        raise source.error(path, f"there is no file `{file}`", hint)
    try:
        npy = file.suffix.lower() == ".npy"
        raw = np.load(file, allow_pickle=False) if npy else _read_csv(file, path, source)
    except (OSError, ValueError, EOFError) as error:
        if isinstance(error, LatticeError):
            raise
        raise source.error(path, f"`{file}` cannot be read: {error}", None) from None
    if not isinstance(raw, np.ndarray) or raw.dtype.kind not in "fiu":
        kind = getattr(raw, "dtype", "other things")
        raise source.error(path, f"`{file}` holds {kind}, not an array of real numbers", None)
    wanted = (*counts, 3)
    if not npy and raw.shape == (int(np.prod(counts)), 3):
        raw = raw.reshape(wanted)
    if raw.shape != wanted:
        shape = f"{raw.shape}" if npy else f"{raw.shape[0]} rows"
        needs = f"{wanted}" if npy else f"{int(np.prod(counts))} rows of x,y,z"
        hint = f"the lattice has {' × '.join(str(count) for count in counts)} control points"
        raise source.error(path, f"`{file}` holds {shape}; needed are {needs}", hint)
    net = raw.astype(np.float64)
    bad = np.argwhere(~np.isfinite(net).all(axis=-1))
    if len(bad):
        place = bad[0].tolist()
        message = f"`{file}` holds a number that is not finite, at control point {place}"
        raise source.error(path, message, None)
    return net


def _read_csv(file: Path, path: KeyPath, source: Source) -> Floats:
    """Rows (n, 3) of a file of x,y,z; a first row of just these words is passed over."""
    rows = []
    for number, line in enumerate(file.read_text(encoding="utf-8-sig").splitlines(), start=1):
        cells = [cell.strip() for cell in line.split(",")]
        header = number == 1 and [cell.lower() for cell in cells] == ["x", "y", "z"]
        if header or cells == [""]:
            continue
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            row = []
        if len(row) != 3:
            message = f"row {number} of `{file}` is not three numbers: {line[:60]!r}"
            raise source.error(path, message, "write x,y,z")
        rows.append(row)
    return np.array(rows, dtype=np.float64).reshape(-1, 3)
