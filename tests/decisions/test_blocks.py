"""Facts about work in blocks: they change no value, and fit into caches."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emacm.decisions.blocks import block_rows, in_blocks, product


@given(st.integers(1, 30), st.integers(1, 9))
def test_blocks_of_any_size_give_what_all_recordings_give_at_once(n_recordings, n_rows):
    X = np.random.default_rng(0).normal(size=(n_recordings, 3))
    np.testing.assert_array_equal(in_blocks(lambda rows: rows**2, X, n_rows, 3), X**2)
    first = in_blocks(lambda rows: rows[:, 0] > 0, X, n_rows, dtype=bool)
    np.testing.assert_array_equal(first, X[:, 0] > 0)


def test_no_recordings_give_no_answers():
    assert in_blocks(lambda rows: rows, np.empty((0, 2)), 8, 2).shape == (0, 2)


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize(
    ("n", "n_features", "n_rows"),
    [(1, 1, 1), (3, 2, 5), (49, 40, 1000), (100, 33, 257), (1000, 51, 248), (7, 600, 2000)],
)
def test_a_product_in_pieces_is_the_product(n, n_features, n_rows, order):
    rng = np.random.default_rng(1)
    matrix = rng.integers(-9, 9, size=(n, n_features)).astype(float)
    columns = np.asarray(rng.integers(-9, 9, size=(n_features, n_rows)), float, order=order)
    np.testing.assert_array_equal(product(matrix, columns), matrix @ columns)


@given(st.integers(1, 10**7))
def test_work_arrays_hold_two_mebibytes_and_rows_keep_off_powers_of_two(numbers):
    n_rows = block_rows(numbers)
    assert n_rows % 16 == 8
    assert n_rows <= 64 or 8 * n_rows * numbers <= 2 * 1024**2
