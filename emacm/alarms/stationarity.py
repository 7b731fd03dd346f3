"""Tests of a baseline: trend, and correlation of successive readings.

References
----------
.. [1] Hamed and Rao, A modified Mann-Kendall trend test for autocorrelated data, Journal of
   Hydrology 204, 182-196, 1998. Here the autocorrelation is that of a process of first order.
.. [2] Wald and Wolfowitz, An exact test for randomness in the non-parametric case based on serial
   correlation, Annals of Mathematical Statistics 14, 378-388, 1943. Here of several columns.
.. [3] Kendall, Note on bias in the estimation of autocorrelation, Biometrika 41, 403-404, 1954.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.signal import detrend
from scipy.stats import kendalltau, norm, rankdata

Array = NDArray[np.float64]


def trend_probability(series: Array, parts: NDArray[np.intp]) -> float:
    """Return the p-value of the modified Mann-Kendall test for a common trend [1]_.

    Parameters
    ----------
    series : ndarray of shape (n_readings,)
        In the order in which they were taken within each part.
    parts : ndarray of int, shape (n_readings,)
        Number of the part (unit, run) of each reading. Parts of less than 4 readings do not count.

    Returns
    -------
    float
        Of readings without a trend, this share has a smaller value. 1 without readings.

    Notes
    -----
    The correlation of successive readings is estimated after a linear trend has been removed, with
    the correction of its bias [3]_; it is at most 0.98.

    Of 1,000 simulated autoregressive series without trend, the share with p < 0.01 is, for
    correlations of successive readings of 0, 0.3, 0.6 and 0.8,

    - 20 readings: 0.007, 0.026, 0.050 and 0.098;
    - 60 readings: 0.005, 0.015, 0.023 and 0.037;
    - 200 readings: 0.006, 0.009, 0.013 and 0.016.

    The correlation of few readings is uncertain, and slow wandering cannot be told from a trend. A
    linear drift of 4 standard deviations is found in 93 and 59 % of series of 20 readings with
    correlations of 0 and 0.6, and in 100 and 92 % of 60; one of 2 in 32, 23, 95 and 42 %; a run-in
    of 4 that decays by exp(-4) in 61, 36, 100 and 56 % (``benchmarks/stated_limits.py``).

    Examples
    --------
    >>> one = np.zeros(20, dtype=int)
    >>> noise = np.random.default_rng(0).normal(size=20)
    >>> [round(trend_probability(noise + x * np.arange(20), one), 3) for x in (0.0, 0.2)]
    [0.604, 0.002]
    """
    runs = [series[parts == k] for k in np.unique(parts)]
    runs = [run for run in runs if len(run) >= 4 and np.ptp(run) > 0]
    if not runs:
        return 1.0
    lengths = [len(run) for run in runs]
    # An exact trend leaves rounding errors, which are no correlation.
    ranks = np.concatenate([detrend(rankdata(run)).round(9) for run in runs])
    numbers = np.repeat(np.arange(len(runs)), lengths)
    correlation = np.clip(lag_correlation(ranks[:, np.newaxis], numbers, lost=4)[0], 0, 0.98)
    taus = [kendalltau(np.arange(len(run)), run).statistic for run in runs]
    score = sum(tau * n * (n - 1) / 2 for tau, n in zip(taus, lengths, strict=True))
    variance = sum(_variance(n, correlation) for n in lengths)
    return float(2 * norm.sf(abs(score) / np.sqrt(variance)))


def lag_correlation(centred: Array, parts: NDArray[np.intp], *, lost: int = 3) -> Array:
    """Return the correlation of successive rows, corrected for its bias -(1 + lost rho) / n [3]_.

    Parameters
    ----------
    centred : ndarray of shape (n_readings, n_columns)
        Deviations from the means of the parts, or from their linear trends.
    parts : ndarray of int, shape (n_readings,)
        Number of the part of each reading, from 0 and in increasing order.
    lost : int
        3 for means, 4 for linear trends.

    Returns
    -------
    ndarray of shape (n_columns,)
    """
    follows = (parts[1:] == parts[:-1])[:, np.newaxis]
    power = np.sum(centred**2, axis=0)
    products = np.sum(centred[1:] * centred[:-1] * follows, axis=0)
    raw = np.divide(products, power, out=np.zeros_like(power), where=power > 0)
    return raw + (1 + lost * raw) / np.bincount(parts).mean()


def _variance(n: int, correlation: float) -> float:
    """Return the variance of Kendall's score of an autoregressive series, equation (14) of [1]."""
    lags = np.arange(1, n)
    weights = (n - lags) * (n - lags - 1) * (n - lags - 2)
    factor = 1 + 2 / (n * (n - 1) * (n - 2)) * np.sum(weights * correlation**lags)
    return float(factor * n * (n - 1) * (2 * n + 5) / 18)


def serial_correlation(rows: Array, parts: NDArray[np.intp]) -> tuple[float, float]:
    """Return the correlation of successive rows, over all columns, and its p-value [2]_.

    Parameters
    ----------
    rows : ndarray of shape (n_readings, n_columns)
        In the order in which they were taken within each part; columns in comparable units.
    parts : ndarray of int, shape (n_readings,)
        Number of the part (unit, run) of each reading, from 0 and in increasing order.

    Returns
    -------
    correlation : float
        Of successive rows, from the means of the parts, with the correction of its bias [3]_.
    probability : float
        Share of 999 random orders within the parts that have a larger one: exact for rows that are
        exchangeable in each part.

    Examples
    --------
    >>> rows = np.repeat(np.random.default_rng(0).normal(size=(10, 3)), 2, axis=0)
    >>> correlation, probability = serial_correlation(rows, np.zeros(20, dtype=int))
    >>> round(correlation, 1), probability
    (0.7, 0.001)
    """
    centred, rng, n_rows = _centred(rows, parts), np.random.default_rng(0), len(rows)
    weights = np.sum(centred**2, axis=0) / np.sum(centred**2)
    observed = weights @ lag_correlation(centred, parts)
    orders = (np.lexsort((rng.random(n_rows), parts)) for _ in range(999))
    n_larger = sum(bool(weights @ lag_correlation(centred[x], parts) >= observed) for x in orders)
    return float(observed), (1 + n_larger) / 1000


def _centred(rows: Array, parts: NDArray[np.intp]) -> Array:
    """Return the deviations from the mean of each part."""
    table = pd.DataFrame(rows)
    return (table - table.groupby(parts).transform("mean")).to_numpy()


def instability(features: Array, parts: NDArray[np.intp]) -> str:
    """Say why healthy rows are not exchangeable; an empty string if nothing contradicts it.

    1 % of sound baselines are called not exchangeable, both tests together. Correlations below 0.2
    hardly change the alarm rate: at 0.2, simulated indices exceed limits of 5 % in 4 to 6 % of
    cases. Fewer than ten rows are not tested.

    Parameters
    ----------
    features : ndarray of shape (n_readings, n_features)
        In the order in which they were taken within each part.
    parts : ndarray of int, shape (n_readings,)
        Number of the part (unit) of each reading, in increasing order.

    Returns
    -------
    str
    """
    if len(parts) < 10:
        return ""
    deviations = _centred(features, parts)
    scale = deviations.std(axis=0)
    scale[scale <= 1e-12 * np.abs(features).max(axis=0)] = np.inf
    standardised = deviations / scale
    leading = np.linalg.svd(standardised, full_matrices=False)[0][:, 0]
    trend = trend_probability(leading, parts)
    if trend < 0.005:
        return f"the features drift (Mann-Kendall test of their leading component, p = {trend:.2g})"
    correlation, probability = serial_correlation(standardised, parts)
    if probability <= 0.005 and correlation >= 0.2:
        return f"successive groups are alike (correlation {correlation:.2f}, p = {probability:.2g})"
    return ""
