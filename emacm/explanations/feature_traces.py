"""From which columns of a table the features of a classifier come.

What a fitted step does is found by asking it: columns are changed one at a time, and one sees
which outputs follow. So any transformer counts, one's own as well, and none is known by name.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.float64]
Steps = tuple[tuple[str, Any], ...]

_DEAF = 1e-9  # an output that answers with this share of the largest answer does not
_BLOCK = 256  # columns asked in one go
_CURVED = 1e-6  # share of its answer by which a linear step may miss the prediction


@dataclass(frozen=True)
class FeatureTrace:
    """The way from a table to the features: element-wise steps, then linear ones.

    Attributes
    ----------
    elementwise, linear : tuple of (name, transformer)
        The fitted steps of each kind.
    sources : ndarray of int, shape (n_positions,)
        Column of the table that each output of the element-wise steps comes from. These
        outputs are called positions.
    matrix : ndarray of shape (n_features, n_positions)
        What the linear steps multiply positions by.
    """

    elementwise: Steps
    linear: Steps
    sources: NDArray[np.intp]
    matrix: Array

    def positions(self, table: Array) -> Array:
        """Apply the element-wise steps, shape (n_recordings, n_positions)."""
        for _, step in self.elementwise:
            table = apply_step(step, table)
        return table

    def features(self, positions: Array) -> Array:
        """Apply the linear steps, shape (n_recordings, n_features)."""
        for _, step in self.linear:
            positions = apply_step(step, positions)
        return positions

    def by_column(self, shares: Array, n_columns: int) -> Array:
        """Add up shares of positions by the column of the table they come from."""
        columns = np.zeros((len(shares), n_columns))
        np.add.at(columns.T, self.sources, shares.T)
        return columns


def trace_features(steps: Sequence[tuple[str, Any]], table: Array) -> FeatureTrace:
    """Find how features follow from the columns of a table.

    Parameters
    ----------
    steps : sequence of (name, transformer)
        Fitted steps after the table; None and "passthrough" are left out.
    table : ndarray of shape (n_recordings, n_columns)
        Rows of the table; the steps are asked near the first.

    Returns
    -------
    FeatureTrace
        Element-wise steps as far as they reach, and linear steps after them.

    Raises
    ------
    ValueError
        If a step is neither element-wise (each output depends on one column) nor linear,
        or is element-wise and not linear after columns were mixed; it is named.

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
    sources = np.arange(row.shape[1])
    elementwise: list[tuple[str, Any]] = []
    linear: list[tuple[str, Any]] = []
    matrix = np.eye(len(sources))
    for name, step in steps:
        if step is None or isinstance(step, str):
            continue
        own = None if linear else _own_sources(step, row)
        if own is not None:
            elementwise.append((name, step))
            sources = sources[own]
            matrix = np.eye(len(sources))
        else:
            matrix = _linear_part(name, step, row) @ matrix
            linear.append((name, step))
        row = apply_step(step, row)
    return FeatureTrace(tuple(elementwise), tuple(linear), sources, matrix)


def apply_step(step: Any, values: Array) -> Array:
    """Transform an array, with the column names that the step was fitted on."""
    return np.asarray(step.transform(with_names(step, values)), dtype=np.float64)


def with_names(estimator: Any, values: Array) -> Any:
    """Return the array, as a DataFrame where the estimator was fitted on names."""
    names = getattr(estimator, "feature_names_in_", None)
    return values if names is None else pd.DataFrame(values, columns=names)


def _own_sources(step: Any, row: Array) -> NDArray[np.intp] | None:
    """Return the one column that each output depends on; None if columns are mixed."""
    if hasattr(step, "get_support"):  # scikit-learn's selectors
        return np.flatnonzero(step.get_support())
    sources: NDArray[np.intp] | None = None
    # A hundredth more leaves a power a power, so that its logarithm exists.
    changes = np.where(row[0] == 0, 1e-3, 0.01 * row[0])
    for asked, answers, size in _answers(step, row, changes):
        if not np.isfinite(answers).all():
            return None
        strength = np.abs(answers)
        heard = strength > _DEAF * strength.max(axis=1, keepdims=True) + 1e-13 * size
        if sources is None:
            sources = np.full(heard.shape[1], -1)
        outputs = heard.any(axis=0)
        if (heard.sum(axis=0) > 1).any() or (sources[outputs] >= 0).any():
            return None
        sources[outputs] = asked.start + heard.argmax(axis=0)[outputs]
    if sources is None:
        return None
    silent = np.flatnonzero(sources < 0)  # at the floor of a logarithm, say
    if len(silent) and len(sources) != row.shape[1]:
        return None
    sources[silent] = silent
    return sources


def _linear_part(name: str, step: Any, row: Array) -> Array:
    """Return the matrix of a linear step, or say why it has none."""
    n_columns = row.shape[1]
    scale = np.sqrt(np.mean(row**2)) or 1.0
    away = scale * np.random.default_rng(0).uniform(-2, 2, (3, n_columns))
    try:
        found = [answers for _, answers, _ in _answers(step, row, np.full(n_columns, scale))]
        with np.errstate(all="ignore"):
            reached = apply_step(step, row + away) - apply_step(step, row)
    except ValueError as error:
        raise _untraceable(name, step) from error
    matrix = np.concatenate(found).T / scale
    predicted = away @ matrix.T
    miss = np.abs(reached - predicted).max(initial=0.0)
    if not miss <= _CURVED * np.abs(predicted).max(initial=0.0):
        raise _untraceable(name, step)
    return matrix


def _answers(step: Any, row: Array, changes: Array) -> Iterator[tuple[slice, Array, Array]]:
    """Change one column at a time; yield how the outputs change, block by block of columns.

    A block is the columns asked, the answers of shape (n_asked, n_outputs), and the size of
    the outputs. Blocks, because thousands of columns make a large square.
    """
    n_columns = row.shape[1]
    with np.errstate(all="ignore"):
        before = apply_step(step, row)
        for start in range(0, n_columns, _BLOCK):
            asked = slice(start, min(start + _BLOCK, n_columns))
            changed = np.repeat(row, asked.stop - start, axis=0)
            changed[np.arange(len(changed)), np.arange(start, asked.stop)] += changes[asked]
            after = apply_step(step, changed)
            yield asked, after - before, np.abs(before) + np.abs(after).max(axis=0)


def _untraceable(name: str, step: Any) -> ValueError:
    return ValueError(
        f"step {name!r} ({type(step).__name__}) cannot be traced back to the bins: what it does is "
        f"neither linear nor, ahead of any step that mixes columns, element-wise. Use a linear "
        f"projection (PCA, LDA) in its place, and logarithms before it."
    )
