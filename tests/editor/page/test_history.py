"""Entries that the user types: files that they name."""

from __future__ import annotations

import pytest

pytest.importorskip("viser")

from ffdcli.editor.page.history import files_named


@pytest.mark.parametrize(
    ("edit", "files"),
    [
        ({"net": "net.npy"}, {"net.npy"}),
        ({"net": {"origin": [0, 0, 0], "points": "/etc/passwd.csv"}}, {"/etc/passwd.csv"}),
        ({"net": {"origin": [0, 0, 0], "points": [[[[0, 0, 0]]]]}}, set()),
        ({"weights": "w.csv"}, {"w.csv"}),
        ({"drag": {"pairs": "table.csv", "hold": [{"group": "seat"}]}}, {"table.csv"}),
        ({"drag": {"pairs": [{"from": [0, 0, 0], "by": [0, 0, 1]}]}}, set()),
        ({"twist": {"axis": "w", "angle": 3}}, set()),
    ],
)
def test_files_that_an_entry_names(edit, files):
    assert files_named(edit) == files
