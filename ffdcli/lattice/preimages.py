"""Points that `embedding: inverse` cannot place: said by number and by the first of them."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.lattice.file.source import Source
from ffdcli.volume.adaptive.parameters import Preimages
from ffdcli.volume.frame import Frame


def require_preimages(found: Preimages, points: Floats, frame: Frame, source: Source) -> None:
    """Refuse points of the mesh that have no parameters, or where the volume at rest folds over.

    Parameters
    ----------
    found : Preimages
    points : (m, 3) float64, lattice frame
        The points that it is about.

    Raises
    ------
    LatticeError
    """
    here = ("octree", "embedding")
    if not found.solved.all():
        said = f"{_count(~found.solved)} no parameters in the volume at rest"
        hint = "leave the box to `box: auto`, enlarge it, or say `embedding: displacement`"
        raise source.error(here, f"{said}, {_first(points, ~found.solved, frame)}", hint)
    folded = found.folded
    if folded.any():
        said = f"{_count(folded)} parameters where the volume at rest folds over"
        hint = "bring `weights` nearer to each other, as in [10, 1], change `depth`, or say "
        hint += "`embedding: displacement`"
        raise source.error(here, f"{said}, {_first(points, folded, frame)}", hint)


def _count(which: Bools) -> str:
    number = int(which.sum())
    have = "has" if number == 1 else "have"
    return f"{number:,} of {len(which):,} points looked at on the mesh {have}"


def _first(points: Floats, which: Bools, frame: Frame) -> str:
    place = frame.to_model(points[np.argmax(which)][None])[0]
    return f"the first at ({', '.join(f'{value:.6g}' for value in place)})"
