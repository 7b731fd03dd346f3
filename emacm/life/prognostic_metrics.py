"""Metrics of predictions of the remaining life."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.stats import beta

from emacm._checks import check_choice, check_finite, check_real_array
from emacm.recordings.meta import read_grouping

Array = NDArray[np.float64]


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

    References
    ----------
    .. [1] P. Nectoux et al., PRONOSTIA: an experimental platform for bearings accelerated
       degradation tests, IEEE Int. Conf. on Prognostics and Health Management, 2012, and the rules
       of the IEEE PHM 2012 data challenge.

    Examples
    --------
    >>> [float(phm2012_lives(source)["Bearing1_4"]) for source in ("official", "files")]
    [339.0, 2890.0]
    """
    check_choice(source, "source", ("official", "files"))
    names = [f"Bearing1_{k}" for k in (3, 4, 5, 6, 7)] + [f"Bearing2_{k}" for k in (3, 4, 5, 6, 7)]
    lives = [5730.0, 339.0, 1610.0, 1460.0, 7570.0, 7530.0, 1390.0, 3090.0, 1290.0, 580.0, 820.0]
    published = pd.Series(lives, index=[*names, "Bearing3_3"], name="remaining life [s]")
    if source == "files":
        published["Bearing1_4"] = 2890.0  # 289 records of 10 s follow the truncated ones
    return published


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

    See Also
    --------
    emacm.monitoring.coverage_by_unit : Share of lives in intervals.
    emacm.monitoring.phm2012_lives : The lives of its data.

    References
    ----------
    .. [1] P. Nectoux et al., PRONOSTIA: an experimental platform for bearings accelerated
       degradation tests, IEEE Int. Conf. on Prognostics and Health Management, 2012, and the rules
       of the IEEE PHM 2012 data challenge.

    Examples
    --------
    >>> round(phm2012_score([100.0, 200.0, 50.0], [105.0, 160.0, 50.0]), 3)
    0.667
    """
    true, predicted = _columns(true=true, predicted=predicted)
    check_finite(predicted, "predicted")
    if (true <= 0).any():
        raise ValueError(f"true must be positive, got {true.min():g}. Leave failed units out.")
    error = 100 * (true - predicted) / true
    return float(np.mean(np.exp(np.log(0.5) * np.where(error <= 0, -error / 5, error / 20))))


def coverage_by_unit(
    true: ArrayLike, lower: ArrayLike, upper: ArrayLike, groups: Any
) -> pd.DataFrame:
    """Return how often intervals contain the true value, by unit.

    Readings of one unit fail together: their number is no number of independent trials.

    Parameters
    ----------
    true, lower, upper : array-like of shape (n_readings,)
        True values and interval limits, which may be infinite.
    groups : array-like of shape (n_readings,)
        Unit of each reading.

    Returns
    -------
    DataFrame
        One row per unit and the row "all": "coverage" (fraction of readings covered; of "all": mean
        over units), "n_readings"; for "all" also "low" and "high", exact binomial limits of
        95 % (Clopper and Pearson) of the mean over units.

    Raises
    ------
    TypeError, ValueError
        If the lengths differ, `true` is not finite, a limit is NaN or `lower` above `upper`.

    See Also
    --------
    emacm.monitoring.phm2012_score : A score of one number.

    Examples
    --------
    >>> coverage_by_unit([5, 6, 2], [4, 4, 3], [7, 9, 8], ["B", "B", "A"])["coverage"].to_dict()
    {'A': 0.0, 'B': 1.0, 'all': 0.5}
    """
    true, low, high = _columns(true=true, lower=lower, upper=upper)
    if not (low <= high).all():
        row = int(np.argmin(low <= high))
        raise ValueError(f"lower is above upper in row {row}: {low[row]:g} and {high[row]:g}.")
    grouping = read_grouping(groups, true, "groups", "unit")
    if grouping is None:
        raise ValueError("groups must give the unit of each reading, got None.")
    covered = pd.Series((low <= true) & (true <= high)).groupby(grouping.labels)
    table = pd.DataFrame({"coverage": covered.mean(), "n_readings": covered.size()})
    n_units, mean = len(table), float(table["coverage"].mean())
    table[["low", "high"]] = np.nan
    hits = mean * n_units
    low_limit = beta.ppf(0.025, hits, n_units - hits + 1) if hits > 0 else 0.0
    high_limit = beta.ppf(0.975, hits + 1, n_units - hits) if hits < n_units else 1.0
    table.loc["all"] = [mean, float(len(true)), low_limit, high_limit]
    return table


def _columns(**values: ArrayLike) -> list[Array]:
    """Return columns of the same length, the first of which is finite."""
    columns = [check_real_array(x, name).astype(np.float64) for name, x in values.items()]
    shapes = [column.shape for column in columns]
    if len(set(shapes)) > 1 or len(shapes[0]) != 1 or not shapes[0][0]:
        raise ValueError(
            f"{', '.join(values)} must be one-dimensional, of the same length, got {shapes}."
        )
    check_finite(columns[0], next(iter(values)))
    return columns
