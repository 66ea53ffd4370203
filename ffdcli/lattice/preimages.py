"""Errors about points that have no parameters with `embedding: inverse`."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.lattice.file.source import Source
from ffdcli.volume.adaptive.parameters import Preimages
from ffdcli.volume.frame import Frame


def require_preimages(found: Preimages, points: Floats, frame: Frame, source: Source) -> None:
    """Reject points of the mesh without parameters, or where the volume at rest folds over.

    Parameters
    ----------
    found : Preimages
    points : (m, 3) float64, lattice frame
        The points that were inverted.

    Raises
    ------
    LatticeError
        States the number of such points and the first of them.
    """
    here = ("octree", "embedding")
    if not found.solved.all():
        message = f"{_count(~found.solved)} no parameters in the volume at rest"
        hint = "use `box: auto`, enlarge the box, or say `embedding: displacement`"
        raise source.error(here, f"{message}, {_first(points, ~found.solved, frame)}", hint)
    folded = found.folded
    if folded.any():
        message = f"{_count(folded)} parameters where the volume at rest folds over"
        hint = "choose closer `weights`, such as [10, 1], change `depth`, or say "
        hint += "`embedding: displacement`"
        raise source.error(here, f"{message}, {_first(points, folded, frame)}", hint)


def _count(which: Bools) -> str:
    number = int(which.sum())
    have = "has" if number == 1 else "have"
    return f"{number:,} of {len(which):,} sampled points of the mesh {have}"


def _first(points: Floats, which: Bools, frame: Frame) -> str:
    place = frame.to_model(points[np.argmax(which)][None])[0]
    return f"the first at ({', '.join(f'{value:.6g}' for value in place)})"
