"""Work on many recordings a block at a time, in arrays that caches hold.

Work arrays put classes and features first and recordings last, so that every sum and
every comparison runs along memory.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

Array = NDArray[np.float64]

_NUMBERS = 1 << 18  # in the largest work array: 2 MiB
_MOST, _LEAST = 1 << 15, 64  # recordings in a block
# Multiplications in one product: BLAS does so many on one thread. Waiting for others takes
# longer than such products do, above all where the cores are busy with other recordings.
_PRODUCT = 519_000
_TALL = 48  # rows of a piece, at the most; with fewer the recordings are read too often


def in_blocks(
    evaluate: Callable[[Array], NDArray[Any]],
    X: Array,
    n_rows: int,
    n_columns: int | None = None,
    dtype: DTypeLike = np.float64,
) -> NDArray[Any]:
    """Evaluate a function of blocks of recordings, and put its answers below one another.

    Parameters
    ----------
    evaluate : callable
        From (n_rows, n_features) to (n_rows, n_columns), or to (n_rows,).
    X : ndarray of shape (n_recordings, n_features)
        Features.
    n_rows : int
        Recordings in one block.
    n_columns : int, default=None
        None if the answer is one value per recording.
    dtype : dtype, default=float64
        Of the result.

    Returns
    -------
    values : ndarray of shape (n_recordings, n_columns) or (n_recordings,)
        All answers.

    Examples
    --------
    >>> in_blocks(lambda rows: rows**2, np.array([[1.0], [2.0], [3.0]]), 2, 1)
    array([[1.],
           [4.],
           [9.]])
    """
    shape = len(X) if n_columns is None else (len(X), n_columns)
    values = np.empty(shape, dtype, order="F")  # as work arrays lie
    for start in range(0, len(X), n_rows):
        block = slice(start, start + n_rows)
        values[block] = evaluate(X[block])
    return values


def block_rows(numbers: int) -> int:
    """Choose how many recordings make one block.

    Parameters
    ----------
    numbers : int
        Size of the largest work array per recording.

    Returns
    -------
    n_rows : int
        An odd multiple of 8: rows of work arrays that are a power of two apart would
        push each other out of the cache.

    Examples
    --------
    >>> block_rows(1000)
    248
    """
    rows = min(max(_NUMBERS // numbers, _LEAST), _MOST)
    return 8 * (rows // 8 - 1 | 1)


def product(matrix: Array, columns: Array) -> Array:
    """Multiply a matrix by the recordings of a block, in pieces that stay on one thread.

    Parameters
    ----------
    matrix : ndarray of shape (n, n_features)
        Any number of rows.
    columns : ndarray of shape (n_features, n_rows)
        One column per recording.

    Returns
    -------
    product : ndarray of shape (n, n_rows)
        Matrix times columns.

    Examples
    --------
    >>> product(np.array([[1.0, 2.0]]), np.array([[3.0], [4.0]]))
    array([[11.]])
    """
    n, n_rows = len(matrix), columns.shape[1]
    if n * columns.size <= _PRODUCT:
        return matrix @ columns
    result = np.empty((n, n_rows))
    height = min(n, 8 * math.ceil(n / math.ceil(n / _TALL) / 8))
    width = max(8, _PRODUCT // (height * len(columns)) // 8 * 8)
    for left in range(0, n_rows, width):
        part = columns[:, left : left + width]
        for top in range(0, n, height):
            piece = result[top : top + height, left : left + width]
            np.matmul(matrix[top : top + height], part, out=piece)
    return result
