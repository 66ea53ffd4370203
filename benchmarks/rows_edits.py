"""Rows about edits by hand."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import cases
import numpy as np
from measure import Row

from ffdcli.deformation import Deformation
from ffdcli.editor import Session
from ffdcli.lattice import Lattice


def edits(name: str, folder: Path) -> Iterator[Row]:
    """Previews of edits by hand, one for each movement of a mouse."""
    frequency, per_axis = (100, 10) if name == "full" else (6, 6)
    points, corners = cases.geodesic_sphere(frequency)
    model = cases.write_obj(folder / "ball.obj", points, corners)
    file = folder / "ball.yaml"
    file.write_text(f"version: 1\npoints: [{per_axis}, {per_axis}, {per_axis}]\n")
    with Session.open(model, file) as session:
        vertices, control = len(session.drawn.rest), session.nets[0].count
        pole, layer = [0.0, 0.0, 1.0], [":", ":", -1]
        ways = {
            "a drag": lambda s: {"drag": {"pairs": [{"from": pole, "by": [0.1, 0.0, 0.2 * s]}]}},
            "a layer moved": lambda s: {"move": {"at": layer, "by": [0.0, 0.0, 0.2 * s]}},
            "a layer turned": lambda s: {
                "transform": {"at": layer, "rotate": {"axis": "w", "angle": 20 * s}}
            },
            "a twist": lambda s: {"twist": {"axis": "w", "angle": 30 * s}},
        }
        for what, edit in ways.items():
            begun = time.process_time()
            session.preview(edit(0.5))
            first = time.process_time() - begun
            begun = time.process_time()
            for step in range(10):
                seen = session.preview(edit(step / 10)).vertices.astype(np.float32)
            spent = (time.process_time() - begun) / 10
            begun = time.process_time()
            member = session.shown.stages.extended(0, session.member(), [edit(0.9)])
            moved = Deformation.of(Lattice((member,), session.lattice.source), session.model.delta)
            wanted = moved.images(session.drawn.rest)
            direct = time.process_time() - begun
            off = np.abs(seen - wanted).max() / session.size
            yield Row(
                f"`ffd edit`: preview of {what}, {vertices:,} vertices, {control:,} control points",
                f"the lattice's own evaluation ({1e3 * direct:.0f} ms)",
                f"{direct / spent:.0f}× faster: {1e3 * spent:.1f} ms of a processor, the first "
                f"{1e3 * first:.0f} ms; off by {off:.0e} × size in single precision",
                "at most 33 ms",
                spent <= 0.033 and off < 1e-6,
            )
