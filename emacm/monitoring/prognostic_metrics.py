"""Metrics of predictions of the remaining life.

References
----------
.. [1] P. Nectoux et al., PRONOSTIA: an experimental platform for bearings accelerated degradation
   tests, IEEE Int. Conf. on Prognostics and Health Management, 2012, and the rules of the IEEE
   PHM 2012 data challenge.
.. [2] A. Saxena et al., Metrics for offline evaluation of prognostic performance, Int. J.
   Prognostics and Health Management 1(1), 2010.
.. [3] T. Gneiting and A. E. Raftery, Strictly proper scoring rules, prediction, and estimation,
   J. Am. Stat. Assoc. 102, 359-378, 2007.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.stats import beta

from emacm._checks import check_choice, check_finite, check_number, check_real_array
from emacm.recordings.meta import read_grouping

Array = NDArray[np.float64]

# Remaining life [s] at the end of the truncated records of the test bearings, as published [1]_.
_PHM2012 = {
    "Bearing1_3": 5730.0,
    "Bearing1_4": 339.0,
    "Bearing1_5": 1610.0,
    "Bearing1_6": 1460.0,
    "Bearing1_7": 7570.0,
    "Bearing2_3": 7530.0,
    "Bearing2_4": 1390.0,
    "Bearing2_5": 3090.0,
    "Bearing2_6": 1290.0,
    "Bearing2_7": 580.0,
    "Bearing3_3": 820.0,
}
_PHM2012_FILES = {"Bearing1_4": 2890.0}  # 289 records of 10 s follow the truncated ones


def phm2012_lives(source: str = "official") -> pd.Series:
    """Return the true remaining lives of the IEEE PHM 2012 challenge [1]_.

    Parameters
    ----------
    source : {"official", "files"}
        The two differ for Bearing1_4: 339 s as published, 2890 s by the number of files in the
        complete records. State which one a score was computed with.

    Returns
    -------
    Series
        Remaining life [s] of each of 11 test bearings at the end of its truncated record.

    Raises
    ------
    ValueError
        If the source is unknown.

    Examples
    --------
    >>> [float(phm2012_lives(source)["Bearing1_4"]) for source in ("official", "files")]
    [339.0, 2890.0]
    """
    check_choice(source, "source", ("official", "files"))
    lives = _PHM2012 if source == "official" else _PHM2012 | _PHM2012_FILES
    return pd.Series(lives, name="remaining life [s]")


def phm2012_score(true: ArrayLike, predicted: ArrayLike) -> float:
    """Return the score of the IEEE PHM 2012 challenge [1]_.

    The percent error ``100 (true - predicted) / true`` of each bearing gives 1 if it is 0, and
    0.5 if the prediction is late by 5 % or early by 20 %; the score is the mean.

    Parameters
    ----------
    true, predicted : array-like of shape (n_units,)
        True (positive) and predicted remaining lives, in the same unit.

    Returns
    -------
    float
        Between 0 and 1 (all exact). Eleven numbers hardly rank methods: predictions whose logarithm
        has errors of standard deviation 0.5 score 0.13 to 0.40 by chance (90 % of cases).

    Raises
    ------
    TypeError, ValueError
        If the lengths differ, a value is not finite, or a true life is not positive.

    Examples
    --------
    >>> round(phm2012_score([100.0, 200.0, 50.0], [105.0, 160.0, 50.0]), 3)
    0.667
    """
    true, predicted = _paired(true, predicted)
    if (true <= 0).any():
        raise ValueError(f"true must be positive, got {true.min():g}. Leave failed units out.")
    error = 100 * (true - predicted) / true
    return float(np.mean(np.exp(np.log(0.5) * np.where(error <= 0, -error / 5, error / 20))))


def alpha_lambda(
    ages: ArrayLike,
    true: ArrayLike,
    predicted: ArrayLike,
    *,
    alpha: float = 0.2,
    fraction: float = 0.5,
) -> bool:
    """Return whether a prediction at a fraction of the way to failure is within alpha [2]_.

    Parameters
    ----------
    ages : array-like of shape (n_readings,)
        Increasing ages of the predictions of one unit, the first at the start of prediction.
    true, predicted : array-like of shape (n_readings,)
        True and predicted remaining lives.
    alpha : float
        Largest error relative to the true remaining life.
    fraction : float
        Lambda: fraction of the time from the first prediction to the failure.

    Returns
    -------
    bool
        Of the first prediction at or after this fraction.

    Raises
    ------
    TypeError, ValueError
        If values are invalid, or there is no prediction after this fraction.

    Examples
    --------
    >>> alpha_lambda([0, 10, 20], [30, 20, 10], [60, 23, 5], fraction=0.3)
    True
    >>> alpha_lambda([0, 10, 20], [30, 20, 10], [60, 23, 5], fraction=0.6)
    False
    """
    ages, true, predicted = _one_unit(ages, true, predicted)
    alpha = check_number(alpha, "alpha", above=0)
    fraction = check_number(fraction, "fraction", at_least=0, below=1)
    wanted = ages[0] + fraction * true[0]
    index = int(np.searchsorted(ages, wanted - 1e-9 * max(abs(wanted), 1)))
    if index == len(ages):
        raise ValueError(f"the last prediction is at age {ages[-1]:g}, before {wanted:g}.")
    return bool(abs(predicted[index] - true[index]) <= alpha * true[index])


def prognostic_horizon(
    ages: ArrayLike, true: ArrayLike, predicted: ArrayLike, *, alpha: float = 0.1
) -> float:
    """Return the time before failure from which predictions stay within alpha of the life [2]_.

    Parameters
    ----------
    ages, true, predicted : array-like of shape (n_readings,)
        As for `alpha_lambda`.
    alpha : float
        Largest error relative to the age at failure.

    Returns
    -------
    float
        True remaining life at the first prediction from which on all are within
        ``alpha * (age + true)``; 0 if the last one is not.

    Raises
    ------
    TypeError, ValueError
        If values are invalid.

    Examples
    --------
    >>> prognostic_horizon([0, 10, 20, 30], [40, 30, 20, 10], [41, 50, 23, 10])
    20.0
    """
    ages, true, predicted = _one_unit(ages, true, predicted)
    alpha = check_number(alpha, "alpha", above=0)
    outside = np.flatnonzero(np.abs(predicted - true) > alpha * (ages + true))
    first = outside[-1] + 1 if len(outside) else 0
    return float(true[first]) if first < len(true) else 0.0


def crps(true: ArrayLike, draws: ArrayLike) -> Array:
    """Return the continuous ranked probability score of predictive distributions [3]_.

    Parameters
    ----------
    true : array-like of shape (n_readings,)
        True values.
    draws : array-like of shape (n_readings, n_draws)
        Draws, or equally probable quantiles, of the predicted distribution of each.

    Returns
    -------
    ndarray of shape (n_readings,)
        ``E|x - true| - E|x - x'| / 2``, in the unit of the values; the absolute error if all draws
        are equal. Small is good.

    Raises
    ------
    TypeError, ValueError
        If the shapes do not match, or a value is not finite.

    Examples
    --------
    >>> crps([3.0, 0.0], [[5.0, 5.0], [-1.0, 1.0]]).tolist()
    [2.0, 0.5]
    """
    true = check_real_array(true, "true").astype(np.float64)
    x = np.sort(check_real_array(draws, "draws").astype(np.float64), axis=-1)
    if x.ndim != 2 or true.shape != x.shape[:1] or not x.shape[1]:
        raise ValueError(
            f"draws must have one row for each of {true.size} true values, and at least one draw "
            f"in each, got shape {x.shape}."
        )
    if not (np.isfinite(true).all() and np.isfinite(x).all()):
        raise ValueError("true and draws must be finite. Replace infinite lives by a longest one.")
    n_draws = x.shape[1]
    # The mean absolute difference of sorted values is a weighted sum of them.
    spread = (2 * np.arange(1, n_draws + 1) - n_draws - 1) @ x.T / n_draws**2
    return np.mean(np.abs(x - true[:, np.newaxis]), axis=1) - spread


def coverage_by_unit(
    true: ArrayLike, lower: ArrayLike, upper: ArrayLike, groups: Any, *, confidence: float = 0.95
) -> pd.DataFrame:
    """Return how often intervals contain the true value, by unit.

    Readings of one unit fail together: their number is no number of independent trials.

    Parameters
    ----------
    true, lower, upper : array-like of shape (n_readings,)
        True values and interval limits, which may be infinite.
    groups : array-like of shape (n_readings,)
        Unit of each reading.
    confidence : float
        Confidence of the interval of the coverage.

    Returns
    -------
    DataFrame
        One row per unit and the row "all": "coverage" (fraction of readings covered; of "all": mean
        over units), "n_readings"; for "all" also "low" and "high", exact binomial limits
        (Clopper and Pearson) of the mean over units.

    Raises
    ------
    TypeError, ValueError
        If the lengths differ, `true` is not finite, a limit is NaN or `lower` above `upper`.

    Examples
    --------
    >>> coverage_by_unit([5, 6, 2], [4, 4, 3], [7, 9, 8], ["B", "B", "A"])["coverage"].to_dict()
    {'A': 0.0, 'B': 1.0, 'all': 0.5}
    """
    confidence = check_number(confidence, "confidence", above=0, below=1)
    true = check_real_array(true, "true").astype(np.float64)
    check_finite(true, "true")
    low = check_real_array(lower, "lower").astype(np.float64)
    high = check_real_array(upper, "upper").astype(np.float64)
    if not true.shape == low.shape == high.shape:
        raise ValueError(
            f"true, lower and upper must have the same length, got shapes {true.shape}, "
            f"{low.shape} and {high.shape}."
        )
    if not (low <= high).all():
        row = int(np.argmin(low <= high))
        raise ValueError(
            f"lower must be at most upper, got {low[row]:g} and {high[row]:g} in row {row}."
        )
    grouping = read_grouping(groups, true, "groups", "unit")
    if grouping is None:
        raise ValueError("groups must give the unit of each reading, got None.")
    covered = pd.Series((low <= true) & (true <= high)).groupby(grouping.labels)
    table = pd.DataFrame({"coverage": covered.mean(), "n_readings": covered.size()})
    n_units, mean = len(table), float(table["coverage"].mean())
    table.loc["all"] = [mean, float(len(true))]
    table[["low", "high"]] = np.nan
    tail, hits = (1 - confidence) / 2, mean * n_units
    low_limit = beta.ppf(tail, hits, n_units - hits + 1) if hits > 0 else 0.0
    high_limit = beta.ppf(1 - tail, hits + 1, n_units - hits) if hits < n_units else 1.0
    table.loc["all", ["low", "high"]] = [low_limit, high_limit]
    return table


def _paired(true: ArrayLike, predicted: ArrayLike) -> tuple[Array, Array]:
    first = check_real_array(true, "true").astype(np.float64)
    second = check_real_array(predicted, "predicted").astype(np.float64)
    if first.ndim != 1 or first.shape != second.shape or not len(first):
        raise ValueError(
            f"true and predicted must be one-dimensional and of the same length, got shapes "
            f"{first.shape} and {second.shape}."
        )
    check_finite(first, "true")
    check_finite(second, "predicted")
    return first, second


def _one_unit(ages: ArrayLike, true: ArrayLike, predicted: ArrayLike) -> tuple[Array, Array, Array]:
    first, second = _paired(true, predicted)
    times, _ = _paired(ages, first)
    if (np.diff(times) <= 0).any():
        raise ValueError("ages must increase: pass the predictions of one unit, in order.")
    return times, first, second
