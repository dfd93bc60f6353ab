"""Sparse matrices times diagonal ones, by their entries."""

import numpy as np
import pytest
import scipy.sparse as sp

from signorini_fx.mechanics.pairs.sparse_scaling import scaled_columns, scaled_rows

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
