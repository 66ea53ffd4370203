"""Sparse factors by nested dissection, against dense linear algebra."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from ffdcli.lattice.fit.cholesky import NotPositive, cholesky, dependent, dissect


def banded(count, reach, seed=0):
    """A positive definite matrix of functions on intervals along a line, and their boxes."""
    rng = np.random.default_rng(seed)
    at = np.arange(count)
    near = np.abs(at[:, None] - at) < reach
    rows = np.where(near, rng.standard_normal((count, count)), 0.0)
    rows = np.triu(rows)
    supports = np.zeros((count, 2, 3))
    supports[:, 1, 1:] = 1.0
    supports[:, 0, 0], supports[:, 1, 0] = at, at + 2 * reach
    return rows.T @ rows + np.eye(count), supports


@pytest.mark.parametrize("count", [3, 150, 151, 700])
def test_solutions_are_those_of_a_dense_solver(count):
    matrix, supports = banded(count, 4)
    order = dissect(supports)
    assert np.array_equal(np.sort(order.rows), np.arange(count))
    right = np.random.default_rng(1).standard_normal((count, 3))
    factors = cholesky(csr_array(matrix), order, 0.0)
    np.testing.assert_allclose(factors.solve(right), np.linalg.solve(matrix, right), atol=1e-9)


def test_a_matrix_that_is_not_positive_definite_is_refused():
    matrix, supports = banded(300, 4)
    matrix[100, 100] = -1.0
    with pytest.raises(NotPositive):
        cholesky(csr_array(matrix), dissect(supports), 0.0)
    matrix[100, 100] = 1e-9
    with pytest.raises(NotPositive):
        cholesky(csr_array(matrix), dissect(supports), 0.0)


def test_dependent_rows_are_as_many_as_the_rank_lacks():
    rng = np.random.default_rng(5)
    count = 400
    places = np.sort(rng.integers(0, 300, count))
    rows = np.zeros((count, 304))
    for i, place in enumerate(places):
        rows[i, place : place + 4] = rng.integers(1, 3, 4)
    supports = np.zeros((count, 2, 3))
    supports[:, 1, 1:] = 1.0
    supports[:, 0, 0], supports[:, 1, 0] = places, places + 4
    found = dependent(csr_array(rows @ rows.T), dissect(supports))
    rank = np.linalg.matrix_rank(rows)
    assert found.sum() == count - rank
    assert np.linalg.matrix_rank(rows[~found]) == rank
