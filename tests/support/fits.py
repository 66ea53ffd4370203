"""Lattices on the unit cube that a fit is solved on, and fields with known values."""

from dataclasses import replace

import numpy as np

from ffdcli.lattice import parse_lattice
from ffdcli.lattice.file.definition import PairTable
from ffdcli.lattice.file.source import Source
from support.lattice_models import box_triangles

CUBE = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
ONE_PAIR = [{"from": [0, 0, 0], "by": [0, 0, 0]}]


def settle(keys, pairs=None):
    """A lattice of these keys, settled by the unit cube; the first edit may get other pairs."""
    file = parse_lattice({"version": 1, **keys}, Source())
    if pairs is not None:
        definition = replace(file.definitions[0], pairs={0: pairs})
        file = replace(file, definitions=(definition,))
    return file.settle(bounds=CUBE, triangles=box_triangles(*CUBE), delta=1e-9)


def table(places, moves):
    """Pairs by displacements."""
    count = len(places)
    return PairTable(places, moves, np.ones(count, dtype=bool), np.ones(count))


def fitted(keys, places, moves, **fit):
    """A lattice of these keys with a fit as its only edit, and the report of the fit."""
    edit = {"fit": {"pairs": ONE_PAIR, **fit}}
    lattice = settle({**keys, "edits": [edit]}, table(places, moves))
    return lattice, lattice.fits[0].as_report()


def grown(places, moves, octree=None, **fit):
    """The same on an octree that the fit divides."""
    keys = {"volume": "hierarchical", "octree": {"depth": "auto", **(octree or {})}}
    return fitted(keys, places, moves, **fit)


def displacements(lattice, places):
    """What a lattice does to places, in model coordinates."""
    frame = lattice.maps[0].frame
    return frame.to_model(lattice.maps[0].evaluate(frame.to_local(places))) - places


def wavy(places):
    """A smooth field."""
    x, y, z = np.asarray(places).T
    return 0.1 * np.stack(
        [np.sin(6 * x) * np.cos(3 * y), np.cos(4 * z + x), np.sin(2 * x * y + 3 * z)], axis=1
    )


def dent(places, middle=(0.3, 0.4, 0.5), width=0.05, depth=0.05):
    """A field that is zero but near a place."""
    apart = ((np.asarray(places) - middle) ** 2).sum(axis=1)
    return np.exp(-apart / (2 * width**2))[:, None] * [0.0, 0.0, depth]
