"""Leaving groups out: every recording is judged by a model that was fitted without its group."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.model_selection import GroupKFold

from emacm._checks import group_codes

Indices = NDArray[np.intp]


def left_out(
    codes: Indices, groups: ArrayLike, max_folds: int = 10
) -> Iterator[tuple[Indices, Indices]]:
    """Yield the recordings that remain and those that are left out, in turn.

    Parameters
    ----------
    codes : ndarray of int, shape (n_recordings,)
        Number of the class of each recording.
    groups : array-like of shape (n_recordings,)
        Labels of recordings that were measured together (unit, run); a group is left out as a
        whole, by scikit-learn's `GroupKFold`; those of each class are divided among the folds.
    max_folds : int, default=10
        Largest number of folds. Of fewer groups, each is left out once.

    Yields
    ------
    others : ndarray of int
        Recordings that remain.
    rows : ndarray of int
        Recordings that are left out.

    Raises
    ------
    ValueError
        If there is not one group for each recording.

    Examples
    --------
    >>> [rows.tolist() for _, rows in left_out(np.zeros(3, int), ["b", "a", "b"])]
    [[0, 2], [1]]
    """
    numbers = group_codes(groups, len(codes))
    # The groups of each class are divided among the folds, so that no fold holds a whole class.
    first = np.unique(numbers, return_index=True)[1]
    folds = np.empty(len(first), dtype=np.intp)
    folds[np.argsort(codes[first], kind="stable")] = np.arange(len(first)) % max_folds
    numbers = folds[numbers]
    n_folds = min(max_folds, len(np.unique(numbers)))
    if n_folds > 1:
        yield from GroupKFold(n_folds).split(codes, groups=numbers)


def single_recordings(codes: Indices, X: Any, max_folds: int = 10) -> Indices:
    """Return the groups of recordings of which nothing is stated.

    The recordings of each class are divided among the folds. Equal rows of a table are together.

    Parameters
    ----------
    codes : ndarray of int, shape (n_recordings,)
        Number of the class of each recording.
    X : table, or list of Recording
        Features, or recordings, which are told apart.
    max_folds : int, default=10
        Number of groups.

    Returns
    -------
    ndarray of int, shape (n_recordings,)

    Examples
    --------
    >>> single_recordings(np.zeros(3, int), np.array([[4.0], [3.0], [4.0]]))
    array([1, 0, 1])
    """
    table = X.to_numpy() if hasattr(X, "to_numpy") else X
    if not isinstance(table, np.ndarray) or table.ndim != 2 or table.dtype.kind not in "fiu":
        table = np.arange(len(codes))
    rows = np.column_stack([codes, table])
    return np.unique(rows, axis=0, return_inverse=True)[1].ravel() % max_folds


def check_judged(judged: NDArray[np.bool_]) -> None:
    """Raise a ValueError if no recording could be judged by others of its class."""
    if not judged.any():
        raise ValueError(
            "no class has recordings in two groups, so that no recording can be judged by others "
            "of its class. Give groups= with at least two groups in one class."
        )
