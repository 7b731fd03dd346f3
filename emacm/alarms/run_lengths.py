"""Average run lengths of control charts on independent normal readings, by integral equations.

The average run length (ARL) is the mean number of readings until an alarm. All functions are for
a known mean and standard deviation; what an estimated baseline costs is computed by
`emacm.alarms.run_lengths.stated_run_length`.

References
----------
.. [1] S. V. Crowder, A simple method for studying run-length distributions of exponentially
   weighted moving average charts, Technometrics 29(4), 401-407, 1987.
.. [2] E. S. Page, Continuous inspection schemes, Biometrika 41, 100-115, 1954.
.. [3] J. M. Lucas and M. S. Saccucci, Exponentially weighted moving average control schemes:
   properties and enhancements, Technometrics 32(1), 1-12, 1990.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain, islice
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import chi2, norm

from emacm.alarms.stationarity import lag_correlation

Array = NDArray[np.float64]


class RunLength(NamedTuple):
    """Average number of readings until a false alarm.

    Attributes
    ----------
    nominal : float
        For one column with a known baseline and independent normal readings.
    stated : float
        With the size, the correlation and the distribution of the baseline, for all columns
        together: readings per false alarm of many machines with baselines like this one. At most
        `nominal`: negative correlations are taken as 0, and errors of the correlation count too.
    kind : {"bootstrap", "at least", "nominal"}
        How `stated` was obtained. "at least": too few alarms in the simulation; `stated` is a
        lower limit with 95 % confidence. "nominal": too few readings or groups; `stated` equals
        `nominal` and must not be relied on.
    correlation : float
        Correlation of successive readings; the largest of all columns.
    n_readings, n_groups : int
        Size of the baseline.
    interval : tuple of two floats
        Contains the average run length of this one chart, for 90 of 100 charts; it may end above
        `nominal`, as the standard deviation of a baseline may be too large by chance. It is
        (stated, inf) if `kind` is "at least", and (0, inf) if it is "nominal".
    """

    nominal: float
    stated: float
    kind: str
    correlation: float
    n_readings: int
    n_groups: int
    interval: tuple[float, float]

    def __str__(self) -> str:
        size = f"{self.n_readings} readings"
        size += f" in {self.n_groups} groups" if self.n_groups > 1 else ""
        if self.kind == "nominal":
            return (
                f"nominal: {self.nominal:.3g} readings per false alarm if the baseline were known "
                f"and readings independent; a baseline of {size} is too small to state more"
            )
        low, high = self.interval
        stated = f"{self.stated:.3g} ({low:.3g} to {high:.3g} in 90 of 100 such charts)"
        stated = f"at least {low:.3g}" if self.kind == "at least" else stated
        return (
            f"{stated} readings per false alarm with this baseline ({size}, correlation "
            f"{self.correlation:.2f}); nominal {self.nominal:.3g}"
        )


def stated_run_length(
    baseline: Array,
    groups: NDArray[np.intp],
    advance: Callable[[Array, Array], Array],
    limit: float,
    nominal: float,
) -> RunLength:
    """Simulate baselines of this size and correlation, and count false alarms after each [1]_.

    Parameters
    ----------
    baseline : ndarray of shape (n_readings, n_columns)
        Readings, in the order in which they were taken within each group.
    groups : ndarray of int, shape (n_readings,)
        Number of the group of each reading, from 0.
    advance : callable
        Next statistic, from statistic and standardised readings, of any shape.
    limit : float
        Limit of the absolute value of the statistic.
    nominal : float
        Average run length with a known baseline.

    Returns
    -------
    RunLength
        The mean and the standard deviation are estimated anew from each simulated baseline. The
        readings after it have the offset of a further group.

    Notes
    -----
    What is stated is an average over baselines: all readings of many machines, each with its own
    baseline of this size, divided by all their false alarms. Each machine also has its own
    correlation and its own resample of the readings, as those of the baseline are uncertain. A
    negative correlation, which would lengthen the run length, counts as 0. The alarm rates of the
    machines are taken as log-normal, which gives the interval.

    Compared with the true run lengths of 200 charts, with baselines of 60, 200 and 500 normal
    readings and correlations of 0, 0.2 and 0.5 (EWMA 0.2 with limit 2.962, CUSUM 0.5 with limit 5):

    - the mean of the stated run lengths never exceeds the run length of a known baseline; over the
      mean of the true alarm rates, that of the stated ones is 0.97 to 1.55, most for 60 readings;
    - the interval contains 91 to 98 % of the true run lengths. Its ends have a ratio of 13, 8 and 4
      (EWMA, 200 readings, correlations of 0, 0.2 and 0.5), as the logarithm of the run length is
      about nine times as sensitive as the standard deviation is.
    """
    n_readings, n_groups = len(baseline), int(groups.max()) + 1
    process = _Process(baseline, groups)
    correlation = float(process.correlations.max())
    size = (correlation, n_readings, n_groups)
    # Of fewer than 50 readings or 5 groups, the correlation is too uncertain. Successive readings
    # of a group state it; each group has one reading without.
    if n_readings - n_groups < 49 or 1 < n_groups < 5:
        return RunLength(nominal, nominal, "nominal", *size, (0.0, np.inf))
    n_steps = int(np.clip(2 * nominal, 500, 4000))
    counts = process.false_alarms(advance, limit, n_steps)
    mean, n_alarms = counts.mean(), counts.sum()
    if n_alarms < 25:
        most = chi2.ppf(0.95, 2 * n_alarms + 2) / 2  # upper limit of a Poisson mean
        least = min(n_steps * len(counts) / most, nominal)
        return RunLength(nominal, least, "at least", *size, (least, np.inf))
    # Alarm rates are log-normal over machines; beyond them, counts scatter as Poisson numbers.
    variance = np.log1p(max(counts.var(ddof=1) - mean, 0.0) / mean**2)
    # 2.3 standard deviations: the least of which 90 % of the intervals contain the run length in
    # all cases (see Notes; ``python -m pytest -m slow tests/alarms`` repeats the comparison).
    ends = np.array([-2.3, 2.3]) * np.sqrt(variance)
    low, high = np.exp(variance / 2 + ends) * n_steps / mean
    stated = min(n_steps / mean, nominal)
    return RunLength(nominal, stated, "bootstrap", *size, (float(low), float(high)))


class _Process:
    """Simulated readings: offset of the group + autoregression of resampled residual blocks.

    Resampling blocks of the readings themselves would weaken their correlation, to which run
    lengths are very sensitive; with blocks of residuals it is kept.
    """

    def __init__(self, baseline: Array, groups: NDArray[np.intp]) -> None:
        self._lengths = np.bincount(groups)
        n_groups = len(self._lengths)
        means = np.array([baseline[groups == g].mean(axis=0) for g in range(n_groups)])
        grand = baseline.mean(axis=0)
        # Deviations of n drawn values are too small by (n - 1) / n on average.
        inflation = np.sqrt(n_groups / (n_groups - 1)) if n_groups > 1 else 0.0
        self._offsets = (means - grand) * inflation
        centred = baseline - means[groups]
        follows = np.flatnonzero(groups[1:] == groups[:-1]) + 1
        self.correlations = np.clip(lag_correlation(centred, groups), -0.98, 0.98)
        residuals = centred[follows] - self.correlations * centred[follows - 1]
        lost = 2 * n_groups  # degrees of freedom: mean and first reading of each group
        factor = np.sqrt(len(residuals) / max(len(residuals) - lost / 2, 1))
        self._residuals = (residuals - residuals.sum(axis=0) / max(len(residuals), 1)) * factor
        self._block = max(1, round(len(baseline) ** 0.25) - 1)

    def false_alarms(
        self, advance: Callable[[Array, Array], Array], limit: float, n_steps: int
    ) -> Array:
        """Return the number of false alarms after each simulated baseline.

        Each machine has its own correlation, from what the baseline tells of it, and at least 0.
        """
        self._rng = np.random.default_rng(0)
        shape = (500, len(self.correlations))
        uncertainty = 1 / np.sqrt(self._lengths.sum() * (1 - self.correlations**2))
        # Half a standard error of caution, so that no length is stated on average that exceeds the
        # one of a known baseline.
        errors = uncertainty * self._rng.normal(0.5, 1.0, shape)
        self._simulated = np.maximum(np.tanh(np.arctanh(self.correlations) + errors), 0.0)
        n_blocks = len(self._residuals) - self._block + 1
        self._rows = self._drawn_rows(self._rng.integers(n_blocks, size=(shape[0], n_blocks)))
        mean, scale = self._estimated_baselines()
        statistic, n_alarms = np.zeros_like(mean), np.zeros(len(mean))
        for readings in islice(self._group(), n_steps):
            statistic = advance(statistic, (readings - mean) / scale)
            alarmed = (np.abs(statistic) > limit).any(axis=1)
            n_alarms += alarmed
            statistic[alarmed] = 0
        return n_alarms

    def _estimated_baselines(self) -> tuple[Array, Array]:
        """Return mean and standard deviation of baselines, each (n_baselines, n_columns)."""
        total, squares = np.zeros((2, *self._simulated.shape))
        for readings in chain.from_iterable(islice(self._group(), n) for n in self._lengths):
            total += readings
            squares += readings**2
        n_readings = self._lengths.sum()
        mean = total / n_readings
        variance = (squares - n_readings * mean**2) / (n_readings - 1)
        # A baseline without variation gives no alarms, as in the chart.
        return mean, np.sqrt(np.where(variance > 0, variance, np.inf))

    def _group(self) -> Iterator[Array]:
        """Yield the readings of each machine in a new group, whose autoregression has settled."""
        group = self._rng.integers(len(self._offsets), size=len(self._simulated))
        offset = self._offsets[group]
        deviation = np.zeros_like(offset)
        for step, rows in enumerate(self._rows):
            deviation = self._simulated * deviation + self._residuals[rows]
            if step >= 50:
                yield offset + deviation

    def _drawn_rows(self, starts: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
        """Yield the next residual of each machine, in blocks of successive ones of its resample."""
        n_machines, n_blocks = starts.shape
        while True:
            block = self._rng.integers(n_blocks, size=n_machines)
            first = starts[np.arange(n_machines), block]
            yield from (first + k for k in range(self._block))


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
    return _mean_length(kernel, np.zeros(len(starts)))


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
    return _mean_length(kernel, at_zero)


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
        raise ValueError(
            f"no limit of this {what} has an average run length of {arl:g}; the shortest is "
            f"{run_length(low):.3g} readings. Give a longer one, or a smaller reference."
        )
    while run_length(high) < arl:
        high *= 1.5
    return float(brentq(lambda x: np.log(min(run_length(x), 1e12) / arl), low, high, xtol=1e-9))


def _nodes(low: float, high: float, width: float) -> tuple[Array, Array]:
    """Return Gauss-Legendre nodes and weights; the error of the quadrature is below 1e-6."""
    nodes, weights = leggauss(min(40 + int(4 * (high - low) / width), 2000))
    half = (high - low) / 2
    return low + half * (nodes + 1), half * weights


def _mean_length(kernel: Array, at_start: Array) -> float:
    """Return the average run length from the start, which is the last row.

    Parameters
    ----------
    kernel : ndarray of shape (n_nodes + 1, n_nodes)
        Probability, by quadrature, that the next statistic is at each node.
    at_start : ndarray of shape (n_nodes + 1,)
        Probability that it is exactly at the start.
    """
    moves = np.column_stack([kernel, at_start])
    try:
        length = np.linalg.solve(np.eye(len(moves)) - moves, np.ones(len(moves)))[-1]
    except np.linalg.LinAlgError:  # no alarm within double precision
        return np.inf
    # The probability of an alarm may be lost in rounding: above, the equations are singular.
    return float(length) if 0 < length < 1e12 else np.inf
