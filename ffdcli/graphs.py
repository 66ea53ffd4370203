"""Connected components of graphs given by arrays."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csgraph

from ffdcli.arrays import Ints


def connected_components(count: int, first: Ints, second: Ints) -> Ints:
    """(count,) component of each node, numbered by first nodes, for links (n,) between nodes."""
    links = (np.ones(len(first), dtype=np.int8), (first, second))
    graph = coo_array(links, shape=(count, count))
    return np.asarray(csgraph.connected_components(graph, directed=False)[1], dtype=np.int64)
