"""Healthy features under each condition, as means or as straight lines over the conditions."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_ROUNDING = 1e-13  # of the largest value; a deviation below it is what rounding leaves of nothing


@dataclass(frozen=True)
class MeanBaseline:
    """Mean and standard deviation of each feature in each condition.

    Attributes
    ----------
    means, scales : mapping of condition to ndarray of shape (n_features,)
        Scales are 1 where nothing is to be divided.
    """

    means: Mapping[Any, Array]
    scales: Mapping[Any, Array]

    def subtracted_from(self, table: Array, conditions: Sequence[Hashable]) -> Array:
        """Express rows relative to the baselines of their conditions.

        Parameters
        ----------
        table : ndarray of shape (n_recordings, n_features)
            Features.
        conditions : sequence of n_recordings
            Conditions; they must be known.

        Returns
        -------
        ndarray of shape (n_recordings, n_features)
        """
        centre = np.array([self.means[condition] for condition in conditions])
        scale = np.array([self.scales[condition] for condition in conditions])
        return (table - centre) / scale


@dataclass(frozen=True)
class LinearBaseline:
    """Straight lines of each feature over the conditions.

    Attributes
    ----------
    coefficients : ndarray of shape (1 + n_conditions, n_features)
        Value at condition 0, and slopes.
    scale : ndarray of shape (n_features,)
        Standard deviation of the residuals; 1 where nothing is to be divided.
    """

    coefficients: Array
    scale: Array

    def subtracted_from(self, table: Array, conditions: ArrayLike) -> Array:
        """Express rows relative to the lines at their conditions.

        Parameters
        ----------
        table : ndarray of shape (n_recordings, n_features)
            Features.
        conditions : array-like of shape (n_recordings,) or (n_recordings, n_conditions)
            Conditions, also such as were never seen.

        Returns
        -------
        ndarray of shape (n_recordings, n_features)
        """
        return (table - _design(conditions) @ self.coefficients) / self.scale


def mean_baseline_of_features(
    table: Array, conditions: Sequence[Hashable], *, scale: bool = False
) -> MeanBaseline:
    """Average healthy features, condition by condition.

    Parameters
    ----------
    table : ndarray of shape (n_recordings, n_features)
        Features of healthy recordings.
    conditions : sequence of n_recordings
        Their conditions.
    scale : bool
        Whether to estimate standard deviations too (divided by N - 1).

    Returns
    -------
    MeanBaseline

    Raises
    ------
    ValueError
        If a standard deviation is 0 or cannot be estimated (the message numbers the feature).

    Examples
    --------
    >>> healthy = np.array([[1.0], [3.0], [7.0]])
    >>> baseline = mean_baseline_of_features(healthy, [20, 20, 40])
    >>> baseline.subtracted_from(np.array([[2.0], [9.0]]), [20, 40]).tolist()
    [[0.0], [2.0]]
    """
    means, scales = {}, {}
    for condition in dict.fromkeys(conditions):
        rows = table[[other == condition for other in conditions]]
        means[condition] = rows.mean(axis=0)
        scales[condition] = np.ones(table.shape[1])
        if scale:
            if len(rows) < 2:
                raise ValueError(
                    f"condition {condition!r} has one healthy recording; a standard deviation "
                    f"needs two. Add recordings, or use scale=False."
                )
            residuals = rows - means[condition]
            scales[condition] = _deviation(residuals, rows, 1, f"in {condition!r} ")
    return MeanBaseline(means, scales)


def linear_baseline_of_features(
    table: Array, conditions: ArrayLike, *, scale: bool = False
) -> LinearBaseline:
    """Fit straight lines to healthy features over the conditions, by least squares.

    Parameters
    ----------
    table : ndarray of shape (n_recordings, n_features)
        Features of healthy recordings.
    conditions : array-like of shape (n_recordings,) or (n_recordings, n_conditions)
        Their conditions, as numbers (load, speed).
    scale : bool
        Whether to estimate the standard deviation of the residuals too.

    Returns
    -------
    LinearBaseline

    Raises
    ------
    ValueError
        If the conditions do not determine a line, or a standard deviation is 0.

    Examples
    --------
    >>> baseline = linear_baseline_of_features(np.array([[1.0], [3.0]]), [20, 40])
    >>> baseline.subtracted_from(np.array([[2.5], [9.0]]), [30, 100]).round(9).tolist()
    [[0.5], [0.0]]
    """
    design = _design(conditions)
    # Columns of one size, so that the rank does not depend on the units of the conditions.
    size = np.abs(design).max(axis=0)
    size[size == 0] = 1
    if np.linalg.matrix_rank(design / size) < design.shape[1]:
        raise ValueError(
            f"{len(np.unique(design, axis=0))} different conditions of healthy recordings do not "
            f"determine {design.shape[1]} coefficients of a line over {design.shape[1] - 1} of "
            f"them. Add healthy recordings under other conditions, or use regression=False."
        )
    coefficients = np.linalg.lstsq(design / size, table, rcond=None)[0] / size[:, np.newaxis]
    if not scale:
        return LinearBaseline(coefficients, np.ones(table.shape[1]))
    if len(design) <= design.shape[1]:
        raise ValueError(
            f"{len(design)} healthy recordings leave no residuals beside {design.shape[1]} "
            f"coefficients. Add recordings, or use scale=False."
        )
    residuals = table - design @ coefficients
    return LinearBaseline(coefficients, _deviation(residuals, table, design.shape[1], ""))


def _design(conditions: ArrayLike) -> Array:
    values = np.asarray(conditions, dtype=np.float64)
    values = values.reshape(len(values), -1)
    return np.column_stack([np.ones(len(values)), values])


def _deviation(residuals: Array, table: Array, used: int, where: str) -> Array:
    deviation = np.sqrt(np.sum(residuals**2, axis=0) / (len(residuals) - used))
    constant = np.flatnonzero(deviation <= _ROUNDING * np.abs(table).max(axis=0))
    if len(constant):
        raise ValueError(
            f"feature {int(constant[0])} {where}is the same in all healthy recordings, and "
            f"nothing can be divided by its deviation. Leave it out, or use scale=False."
        )
    return deviation
