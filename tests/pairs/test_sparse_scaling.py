"""Sparse matrices times diagonal ones, of components, and beside each other, by their entries."""

import numpy as np
import pytest
import scipy.sparse as sp

from signorini_fx.mechanics.pairs.sparse_scaling import beside, of_components, scaled_columns, scaled_rows

MATRIX = sp.csr_array(np.array([[0.0, 2.0, -1.0], [3.0, 0.0, 0.5], [0.0, 0.0, 0.0], [7.0, -4.0, 1.0]]))


@pytest.mark.parametrize("factors", [[2.0, -1.0, 0.5, 3.0], [0.0, 1.0, 4.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
def test_products(factors):
    """They are the products with diagonal matrices, to the bit, with no entries where a factor is zero; the matrix
    itself stays.
    """
    factors, before = np.array(factors), MATRIX.toarray()
    rows, columns = scaled_rows(factors, MATRIX), scaled_columns(MATRIX, factors[:3])
    assert np.array_equal(rows.toarray(), np.diag(factors) @ before)
    assert np.array_equal(columns.toarray(), before @ np.diag(factors[:3]))
    assert rows.data.all()
    assert columns.data.all()
    assert np.array_equal(np.diff(rows.indptr), np.where(factors != 0.0, np.diff(MATRIX.indptr), 0))
    assert np.array_equal(MATRIX.toarray(), before)


def test_components_and_neighbours():
    """As scipy's products with an identity and its stacks, with empty rows and unsorted columns."""
    rng = np.random.default_rng(1)
    first, second = (sp.random_array((7, size), density=0.3, rng=rng, format="csr") for size in (4, 5))
    first.data[2] = 0.0
    first.indices[: first.indptr[1]] = first.indices[: first.indptr[1]][::-1].copy()
    for count in (1, 2, 3):
        expected = sp.kron(first, sp.eye_array(count)).toarray()
        assert (of_components(first, count).toarray() == expected).all()
    assert (beside(first, second).toarray() == sp.hstack((first, second)).toarray()).all()
    assert beside(sp.csr_array((0, 4)), sp.csr_array((0, 2))).shape == (0, 6)
    assert of_components(sp.csr_array((2, 3)), 2).shape == (4, 6)
