"""Parts with a vertex off the ends of its edges: their files have shorter edges, and are right."""

import numpy as np
import pytest

from ffdcli import deform, read_lattice, read_part
from ffdcli.verify.part.file import verify_part_file
from support.parts import write_loose_block

GAP = 0.003
BENT = """\
version: 1
degree: [3, 3, 3]
points: [5, 4, 4]
box: {min: [-4, -3, -2], max: [4, 3, 2]}
edits:
  - twist: {axis: u, angle: 20}
"""


@pytest.fixture(scope="module")
def bent(tmp_path_factory):
    """Part, lattice, file and bound of the loose block, bent."""
    folder = tmp_path_factory.mktemp("loose")
    (folder / "lattice.yaml").write_text(BENT)
    part = read_part(write_loose_block(folder, GAP))
    lattice = read_lattice(folder / "lattice.yaml", part)
    result = deform(part, lattice, fit_tolerance=1e-5).write(folder / "out.step")
    return part, lattice, folder / "out.step", max(result.max_error, 1e-6)


def test_the_file_passes_though_its_reader_cuts_edges_at_the_vertex(bent):
    part, lattice, path, bound = bent
    again = read_part(path)
    shorter = np.ptp(part.edge_range, axis=1) - np.ptp(again.edge_range, axis=1)
    assert shorter.max() > 10 * bound
    verdict = verify_part_file(path, part, lattice, tolerance=bound)
    assert verdict.passed, (verdict.reasons, verdict.undecided)


def test_the_file_is_not_that_of_the_block_without_the_gap(bent, tmp_path):
    _, lattice, path, bound = bent
    tight = read_part(write_loose_block(tmp_path, 0.0))
    verdict = verify_part_file(path, tight, lattice, tolerance=bound)
    assert any("points on edges" in reason for reason in verdict.reasons)
