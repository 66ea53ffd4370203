"""A file with many lattices: only neighbours are compared, and what they share is locked."""

import itertools

import numpy as np
import pytest

from ffdcli.errors import LatticeError
from ffdcli.lattice import box_contacts
from ffdcli.lattice.file.source import parse_yaml
from ffdcli.lattice.lattice_file import parse_lattice


def test_only_neighbours_of_many_boxes_are_compared(monkeypatch):
    compared = []
    plain = box_contacts.find_contact

    def counting(*given):
        compared.append(given)
        return plain(*given)

    monkeypatch.setattr(box_contacts, "find_contact", counting)
    side = 5
    entries = [
        f"- {{box: {{min: [{a}, {b}, {c}], max: [{a + 1}, {b + 1}, {c + 1}]}}}}\n"
        for a, b, c in itertools.product(range(side), repeat=3)
    ]
    text = "version: 1\nlattices:\n" + "".join(entries)
    triangle = np.array([[[0.5, 0.5, 0.5], [4.5, 0.5, 0.5], [0.5, 4.5, 4.5]]])
    bounds = np.stack([triangle.min(axis=(0, 1)), triangle.max(axis=(0, 1))])
    lattice = parse_lattice(*parse_yaml(text)).settle(bounds=bounds, triangles=triangle, delta=1e-9)
    # Of 125 boxes in a cube, pairs that touch at a side, edge or corner: (3n - 2)^3 counts each
    # box with itself and each pair twice.
    assert len(compared) == ((3 * side - 2) ** 3 - side**3) // 2
    assert len(lattice.members) == side**3


def test_more_lattices_than_allowed_are_refused_by_number():
    entries = "".join(
        f"- {{box: {{min: [{n}, 0, 0], max: [{n + 1}, 1, 1]}}}}\n" for n in range(1001)
    )
    with pytest.raises(LatticeError, match=r"has 1,001 entries; 1,000 are allowed") as caught:
        parse_lattice(*parse_yaml(f"version: 1\nlattices:\n{entries}"))
    assert caught.value.key == "lattices"
