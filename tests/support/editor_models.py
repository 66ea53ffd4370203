"""Models and lattice files for tests of sessions that edit by hand."""

import numpy as np

from ffdcli.editor import Session
from support.mesh_models import off

# A box [0, 4] x [0, 3] x [0, 2] of six quads, symmetric about the planes through its middle.
CORNERS = np.array(
    [[x, y, z] for z in (0, 2) for x, y in ((0, 0), (4, 0), (4, 3), (0, 3))], dtype=float
)
QUADS = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]

KINDS = {
    "bspline": "version: 1\n",
    "turned": "version: 1\nbox: {center: [2, 1.5, 1], size: [6, 6, 6], "
    "axes: [[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]]}\n",
    "nurbs": "version: 1\nvolume: nurbs\nedits:\n  - weight: {at: [2, 2, 3], value: 3}\n",
    "hierarchical": "version: 1\nvolume: hierarchical\noctree: {depth: 2}\n",
    "tspline": "version: 1\nvolume: tspline\noctree: {depth: 2}\n",
    "inverse": "version: 1\nvolume: tspline\noctree: {depth: 2, embedding: inverse}\n",
    "unclamped": "version: 1\nends: unclamped\ndegree: [2, 3, 1]\n",
}
# Two lattices that touch.
SEVERAL = """version: 1
lattices:
  - box: {min: [-1, -1, -1], max: [2, 4, 3]}
    points: [7, 5, 5]
  - box: {min: [2, -1, -1], max: [5, 4, 3]}
    volume: nurbs
    points: [7, 5, 5]
    edits:
      - weight: {at: [3, 2, 2], value: 2}
"""


def box_file(folder):
    """The box as a mesh file."""
    path = folder / "box.off"
    path.write_text(off(CORNERS, QUADS))
    return path


def session_of(folder, text="version: 1\n", **keys):
    """A session of the box and a lattice file with a text."""
    lattice = folder / "lattice.yaml"
    if not lattice.exists():
        lattice.write_text(text)
    return Session.open(box_file(folder), lattice, **keys)
