"""Dependence of the features of a classifier on the columns of a table.

The dependence is determined by experiment: the columns are changed one at a time, and the changes
of the outputs are observed. This works for any transformer, including user-defined ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.float64]
Steps = tuple[tuple[str, Any], ...]


@dataclass(frozen=True)
class FeatureTrace:
    """The steps from a table to the features: element-wise steps, then linear ones.

    Attributes
    ----------
    elementwise, linear : tuple of (name, transformer)
        The fitted steps of each kind.
    matrix : ndarray of shape (n_features, n_columns)
        Matrix of the linear steps, which is applied to the outputs of the element-wise steps.
        These outputs, one for each column of the table, are called positions.
    """

    elementwise: Steps
    linear: Steps
    matrix: Array

    def positions(self, table: Array) -> Array:
        """Apply the element-wise steps, shape (n_recordings, n_columns)."""
        for _, step in self.elementwise:
            table = apply_step(step, table)
        return table

    def features(self, positions: Array) -> Array:
        """Apply the linear steps, shape (n_recordings, n_features)."""
        for _, step in self.linear:
            positions = apply_step(step, positions)
        return positions


def trace_features(steps: Sequence[tuple[str, Any]], table: Array) -> FeatureTrace:
    """Determine the element-wise and linear steps from the columns of a table to the features.

    Parameters
    ----------
    steps : sequence of (name, transformer)
        Fitted steps after the table.
    table : ndarray of shape (n_recordings, n_columns)
        Rows of the table; the steps are tested near the first.

    Returns
    -------
    FeatureTrace
        The leading element-wise steps, and the linear steps after them.

    Raises
    ------
    ValueError
        If a step is neither element-wise (each output depends on its own column) nor linear,
        is nonlinear after a step that mixes columns, or gives a value that is not finite; the
        message gives its name.

    Examples
    --------
    >>> from sklearn.decomposition import PCA
    >>> from sklearn.preprocessing import StandardScaler
    >>> X = np.random.default_rng(0).normal(size=(9, 3))
    >>> scaler, pca = StandardScaler().fit(X), PCA(2).fit(StandardScaler().fit_transform(X))
    >>> trace = trace_features([("scaler", scaler), ("pca", pca)], X)
    >>> [name for name, _ in trace.elementwise], np.allclose(trace.matrix, pca.components_)
    (['scaler'], True)
    """
    row = np.asarray(table, dtype=np.float64)[:1]
    elementwise: list[tuple[str, Any]] = []
    linear: list[tuple[str, Any]] = []
    matrix = np.eye(row.shape[1])
    for name, step in steps:
        after = apply_step(step, row)
        if not np.isfinite(after).all():
            raise ValueError(
                f"step {name!r} ({type(step).__name__}) gives a value that is not finite, such as "
                f"the logarithm of a channel without power. Check the channels of the recording."
            )
        if not linear and _is_elementwise(step, row):
            elementwise.append((name, step))
        else:
            matrix = _linear_part(name, step, row) @ matrix
            linear.append((name, step))
        row = after
    return FeatureTrace(tuple(elementwise), tuple(linear), matrix)


def apply_step(step: Any, values: Array) -> Array:
    """Transform an array, with the column names that the step was fitted on."""
    with np.errstate(all="ignore"):
        return np.asarray(step.transform(with_names(step, values)), dtype=np.float64)


def with_names(estimator: Any, values: Array) -> Any:
    """Return the array, as a DataFrame where the estimator was fitted on names."""
    names = getattr(estimator, "feature_names_in_", None)
    return values if names is None else pd.DataFrame(values, columns=names)


def _is_elementwise(step: Any, row: Array) -> bool:
    """Return whether each output depends on the column in its place only."""
    # One per cent more leaves a positive value positive, so that its logarithm exists.
    responses, size = _responses(step, row, np.where(row[0] == 0, 1e-3, 0.01 * row[0]))
    strength = np.abs(responses)
    if strength.shape[0] != strength.shape[1] or not np.isfinite(strength).all():
        return False
    responds = strength > 1e-9 * strength.max(axis=1, keepdims=True) + 1e-13 * size
    return not np.any(responds & ~np.eye(len(responds), dtype=bool))


def _linear_part(name: str, step: Any, row: Array) -> Array:
    """Return the matrix of a linear step; raise if it is not linear."""
    n_columns = row.shape[1]
    scale = np.sqrt(np.mean(row**2)) or 1.0
    away = scale * np.random.default_rng(0).uniform(-2, 2, (3, n_columns))
    matrix = _responses(step, row, np.full(n_columns, scale))[0].T / scale
    measured = apply_step(step, row + away) - apply_step(step, row)
    predicted = away @ matrix.T
    deviation = np.abs(measured - predicted).max(initial=0.0)
    if not deviation <= 1e-6 * np.abs(predicted).max(initial=0.0):
        raise ValueError(
            f"step {name!r} ({type(step).__name__}) cannot be traced back to the bins: it must be "
            f"linear, or element-wise and before any step that mixes columns. Replace it by a "
            f"linear projection (PCA, LDA), and take logarithms before that."
        )
    return matrix


def _responses(step: Any, row: Array, changes: Array) -> tuple[Array, Array]:
    """Change one column at a time; return the changes and the magnitudes of the outputs.

    The changes have the shape (n_columns, n_outputs).
    """
    before, after = apply_step(step, row), apply_step(step, row + np.diag(changes))
    return after - before, np.abs(before) + np.abs(after).max(axis=0)
