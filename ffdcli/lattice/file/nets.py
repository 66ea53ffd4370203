"""Control points and weights that `net` and `weights` edits set, from the file or .npy and .csv."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.lattice.file.edit_models import NetEdit, ShiftedNet, WeightsEdit
from ffdcli.lattice.file.source import KeyPath, Source
from ffdcli.lattice.file.spec import LatticeSpec
from ffdcli.lattice.file.tables import find_file, read_table


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
                nets[index] = _read(points, counts, ("x", "y", "z"), path, source)
            else:
                nets[index] = np.array(points, dtype=np.float64)
        elif isinstance(edit, WeightsEdit):
            path = ("edits", index, "weights")
            weights = edit.weights
            if isinstance(weights, str):
                nets[index] = _read(weights, counts, ("weight",), path, source)
                _require_positive(nets[index], source.folder / weights, path, source)
            else:
                nets[index] = np.array(weights, dtype=np.float64)
    return nets


def _read(
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
        _, raw = read_table(file, (columns,), path, source)
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
    net = raw.astype(np.float64)
    bad = np.argwhere(~np.isfinite(net.reshape(*counts, -1)).all(axis=-1))
    if len(bad):
        place = bad[0].tolist()
        message = f"`{file}` holds a number that is not finite, at control point {place}"
        raise source.error(path, message, None)
    return net


def _read_npy(file: Path, path: KeyPath, source: Source) -> Floats:
    try:
        raw = np.load(file, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise source.error(path, f"`{file}` cannot be read: {error}", None) from None
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
