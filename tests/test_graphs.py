"""Connected components of graphs."""

import numpy as np

from ffdcli.graphs import connected_components


def test_components_are_numbered_by_their_first_nodes():
    first, second = np.array([4, 1, 3]), np.array([0, 3, 1])
    assert connected_components(6, first, second).tolist() == [0, 1, 2, 1, 0, 3]


def test_a_graph_without_links():
    none = np.zeros(0, dtype=np.int64)
    assert connected_components(2, none, none).tolist() == [0, 1]
    assert connected_components(0, none, none).tolist() == []
