"""Average run lengths of control charts on independent normal readings, by integral equations.

The average run length (ARL) is the mean number of readings until an alarm. All functions are for
a known mean and standard deviation; what an estimated baseline costs is computed by
`emacm.monitoring.baseline_run_length.stated_run_length`.

References
----------
.. [1] S. V. Crowder, A simple method for studying run-length distributions of exponentially
   weighted moving average charts, Technometrics 29(4), 401-407, 1987.
.. [2] E. S. Page, Continuous inspection schemes, Biometrika 41, 100-115, 1954.
.. [3] J. M. Lucas and M. S. Saccucci, Exponentially weighted moving average control schemes:
   properties and enhancements, Technometrics 32(1), 1-12, 1990.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.optimize import brentq
from scipy.stats import norm

_LEAST_NODES = 40
_LONGEST = 1e12  # readings; above, the equations are singular in double precision
_NODES_PER_WIDTH = 4  # of the kernel; the error of the quadrature is then below 1e-6
_MOST_NODES = 2000
LONGEST = 1e9  # readings; a limit with a longer average run length is of no use


def ewma_run_length(weight: float, limit: float, shift: float = 0.0) -> float:
    """Return the average run length of a two-sided EWMA chart [1]_.

    Parameters
    ----------
    weight : float
        Weight of the newest reading, in (0, 1].
    limit : float
        Limit, in standard deviations of the chart's statistic in the long run.
    shift : float
        Shift of the mean from the first reading on, in standard deviations of a reading.

    Returns
    -------
    float
        Mean number of readings until the alarm, starting at the mean of the baseline; infinite
        from 1e12 on, which cannot be computed.

    Examples
    --------
    The published value is 500 [3]_:

    >>> round(ewma_run_length(0.2, 2.962))
    500
    """
    half = limit * np.sqrt(weight / (2 - weight))
    nodes, weights = _nodes(-half, half, weight)
    starts = np.append(nodes, 0.0)[:, np.newaxis]
    kernel = norm.pdf((nodes - (1 - weight) * starts) / weight - shift) * weights / weight
    return _solved(kernel[:-1], kernel[-1])


def cusum_run_length(reference: float, limit: float, shift: float = 0.0) -> float:
    """Return the average run length of an upward CUSUM chart [2]_.

    Parameters
    ----------
    reference : float
        Reference value, in standard deviations of a reading: half of the shift to be detected.
    limit : float
        Limit of the sum, in standard deviations of a reading.
    shift : float
        Shift of the mean from the first reading on, in standard deviations of a reading.

    Returns
    -------
    float
        Mean number of readings until the alarm, starting at a sum of 0; infinite from 1e12 on,
        which cannot be computed.

    Examples
    --------
    >>> round(cusum_run_length(0.5, 5.0)), round(cusum_run_length(0.5, 5.0, shift=1.0), 1)
    (931, 10.4)
    """
    nodes, weights = _nodes(0.0, limit, 1.0)
    starts = np.append(nodes, 0.0)
    step = reference - shift
    kernel = norm.pdf(nodes - starts[:, np.newaxis] + step) * weights
    at_zero = norm.cdf(step - starts)  # probability that the next sum is 0
    full = np.column_stack([kernel, at_zero])
    return _resolved(float(_lengths(full)[-1]))


def limit_for(run_length: Callable[[float], float], arl: float, what: str) -> float:
    """Return the limit whose average run length is `arl`.

    Raises
    ------
    ValueError
        If no limit has this average run length.

    Examples
    --------
    >>> round(limit_for(lambda limit: cusum_run_length(0.5, limit), 930, "CUSUM"), 2)
    5.0
    """
    low, high = 1e-3, 1.0
    if run_length(low) >= arl:
        shortest = min(run_length(low), _LONGEST)
        remedy = "Give a longer one" if shortest < LONGEST else "Give a smaller reference"
        raise ValueError(
            f"no limit of this {what} has an average run length of {arl:g}; the shortest is "
            f"{shortest:.3g} readings{' or more' if shortest == _LONGEST else ''}. {remedy}."
        )
    while run_length(high) < arl:
        high *= 1.5
    return float(brentq(lambda x: np.log(min(run_length(x), _LONGEST) / arl), low, high, xtol=1e-9))


def _nodes(low: float, high: float, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Return Gauss-Legendre nodes and weights that resolve a kernel of this width."""
    wanted = _LEAST_NODES + int(_NODES_PER_WIDTH * (high - low) / width)
    nodes, weights = leggauss(min(wanted, _MOST_NODES))
    half = (high - low) / 2
    return low + half * (nodes + 1), half * weights


def _solved(kernel: np.ndarray, from_start: np.ndarray) -> float:
    return _resolved(float(1 + from_start @ _lengths(kernel)))


def _lengths(kernel: np.ndarray) -> np.ndarray:
    try:
        return np.linalg.solve(np.eye(len(kernel)) - kernel, np.ones(len(kernel)))
    except np.linalg.LinAlgError:  # no alarm within double precision
        return np.full(len(kernel), np.inf)


def _resolved(length: float) -> float:
    """Return a run length; infinite where the probability of an alarm is lost in rounding."""
    return length if 0 < length < _LONGEST else np.inf
