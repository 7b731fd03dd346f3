"""Alarms on readings: EWMA and CUSUM charts in standard deviations of a baseline."""

from __future__ import annotations

from itertools import accumulate
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.validation import check_is_fitted, validate_data

from emacm._checks import check_finite_readings, check_number, check_table, group_codes
from emacm._saved import SavedEstimator
from emacm._statements import warn
from emacm.alarms import run_lengths
from emacm.alarms.run_lengths import RunLength
from emacm.alarms.stationarity import trend_probability

Array = NDArray[np.float64]


class AlarmReadings(NamedTuple):
    """Statistic and alarm of each reading and column.

    Attributes
    ----------
    statistic : ndarray of shape (n_readings, n_columns)
        Statistic of the chart, in the unit of its limit.
    alarm : ndarray of bool, shape (n_readings, n_columns)
        Whether the statistic is beyond the limit.
    """

    statistic: Array
    alarm: NDArray[np.bool_]


class _Chart(SavedEstimator):
    """A control chart on each column of a table of readings."""

    limit: float | None
    mean_: Array
    scale_: Array
    statistic_: Array

    @property
    def arl(self) -> Any:
        """Function `arl(shift=0.0)`: average run length with a known baseline.

        Readings are independent and normal, and their mean is shifted by `shift` standard
        deviations from the first reading on; 0: the mean number of readings until a false alarm.
        """
        return self._average_run_length

    @arl.setter
    def arl(self, value: Any) -> None:
        # The parameter and the function have the same name: one is set, the other is read.
        self.__dict__["arl"] = value

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the parameters.

        Parameters
        ----------
        deep : bool, default=True
            As in scikit-learn; a chart contains no other estimators.

        Returns
        -------
        dict
            Parameters by name.
        """
        return super().get_params(deep) | {"arl": self.__dict__["arl"]}

    def fit(self, X: Any, y: Any = None, *, groups: ArrayLike | None = None) -> Self:
        """Estimate mean and standard deviation of a baseline, and state the average run length.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_readings, n_columns)
            Readings of healthy machines in the order in which they were taken: band levels, a
            health index (of recordings that were left out: `HealthIndex.left_out_`), an expected
            cost.
        y : None
            Ignored.
        groups : array-like of shape (n_readings,), optional
            Unit or run of each reading. The standard deviation then includes the differences
            between them, and the stated run length is that of a further unit. Default: successive
            readings of one machine.

        Returns
        -------
        Self
            Itself.

        Raises
        ------
        TypeError, ValueError
            If a parameter or X is invalid, or all columns are constant.

        Warns
        -----
        EmacmWarning
            If the readings of a column drift (see `emacm.alarms.stationarity`).
        """
        limit = self._limit()
        X = self._table(X, ensure_min_samples=2)
        numbers = np.zeros(len(X), dtype=np.intp) if groups is None else group_codes(groups, len(X))
        order = np.argsort(numbers, kind="stable")
        self.mean_, scale = X.mean(axis=0), X.std(axis=0, ddof=1)
        constant = scale <= 1e-12 * np.abs(self.mean_)
        if constant.all():
            raise ValueError(
                f"X has no variation in any of {len(scale)} columns over {len(X)} readings; an "
                f"alarm needs the standard deviation of a baseline. Leave such columns out."
            )
        self.scale_ = np.where(constant, np.inf, scale)
        self.limit_ = limit
        self.run_length_: RunLength = run_lengths.stated_run_length(
            X[order][:, ~constant], numbers[order], self._next, limit, self._run_length(limit, 0.0)
        )
        _warn_of_drift(X[order], numbers[order])
        self.reset()
        return self

    def update(self, X: Any) -> AlarmReadings:
        """Continue the chart with one or several readings.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_columns,) or (n_readings, n_columns)
            The next readings, one row each. One by one or all at once gives the same result.

        Returns
        -------
        AlarmReadings
            Statistic and alarm of each reading. The chart continues after an alarm; `reset`
            starts it again, for example after a repair.

        Raises
        ------
        TypeError, ValueError
            If the chart is not fitted, or a reading is not finite or has other columns.
        """
        check_is_fitted(self)
        rows: Any = [X] if np.ndim(X) == 1 else X
        X = self._table(rows, reset=False)
        standardised = (X - self.mean_) / self.scale_
        statistics = np.array([*accumulate(standardised, self._next, initial=self.statistic_)][1:])
        self.statistic_ = statistics[-1].copy()
        return AlarmReadings(statistics, np.abs(statistics) > self.limit_)

    def reset(self) -> Self:
        """Start the chart again at the mean of the baseline.

        Returns
        -------
        Self
            Itself.
        """
        self.statistic_ = np.zeros(len(self.mean_))
        return self

    def _table(self, X: Any, **options: Any) -> Array:
        check_table(X)
        X = validate_data(self, X, dtype=np.float64, ensure_all_finite=False, **options)
        check_finite_readings(X, self)
        return X

    def _limit(self) -> float:
        """Return the limit: given, or from the average run length."""
        limit, arl = self.limit, self.__dict__["arl"]
        if limit is not None and arl is not None:
            raise ValueError(f"give limit or arl, got both: limit={limit!r}, arl={arl!r}.")
        if limit is not None:
            return check_number(limit, "limit", above=0, at_most=100)
        arl = check_number(500.0 if arl is None else arl, "arl", above=1, at_most=1e9)
        return run_lengths.limit_for(lambda x: self._run_length(x, 0.0), arl, type(self).__name__)

    def _average_run_length(self, shift: float = 0.0) -> float:
        return self._run_length(self._limit(), check_number(shift, "shift"))

    def _run_length(self, limit: float, shift: float) -> float:
        """Return the average run length with a known baseline."""
        raise NotImplementedError

    def _next(self, statistic: Array, standardised: Array) -> Array:
        """Return the next statistic; there is an alarm if it is farther from 0 than the limit."""
        raise NotImplementedError


class EWMA(_Chart):
    """Two-sided alarm on an exponentially weighted moving average of readings [1]_.

    Detects small lasting shifts in either direction. The statistic is the weighted mean of the
    standardised readings, divided by its standard deviation in the long run.

    Parameters
    ----------
    weight : float, default=0.2
        Weight of the newest reading, in (0, 1]; 1 is a Shewhart chart.
    limit : float, optional
        Limit, in standard deviations of the statistic.
    arl : float, optional
        Average run length from which the limit is computed, for a known baseline. Default: 500,
        unless `limit` is given.

    Attributes
    ----------
    mean_, scale_ : ndarray of shape (n_columns,)
        Mean and standard deviation of the baseline. The scale of a constant column is infinite:
        it never gives an alarm.
    limit_ : float
        The limit.
    run_length_ : RunLength
        Readings per false alarm, nominal and for the baseline actually used, with an interval.
    statistic_ : ndarray of shape (n_columns,)
        The present statistic.

    See Also
    --------
    emacm.monitoring.CUSUM : For a shift upwards.
    emacm.monitoring.HealthIndex : An index to watch.

    References
    ----------
    .. [1] J. M. Lucas and M. S. Saccucci, Technometrics 32(1), 1-12, 1990.

    Examples
    --------
    >>> round(EWMA(0.2, limit=2.962).arl()), round(EWMA(0.2, limit=2.962).arl(shift=1.0), 1)
    (500, 10.5)
    >>> baseline = np.random.default_rng(3).normal(5.0, 0.5, (100, 1))
    >>> chart = EWMA(0.2, arl=1000).fit(baseline)
    >>> chart.update([[5.1], [6.5], [6.8], [6.9]]).alarm.ravel().tolist()
    [False, False, True, True]
    """

    def __init__(
        self, weight: float = 0.2, limit: float | None = None, arl: float | None = None
    ) -> None:
        self.weight = weight
        self.limit = limit
        self.arl = arl

    def _run_length(self, limit: float, shift: float) -> float:
        weight = check_number(self.weight, "weight", above=0, at_most=1)
        return run_lengths.ewma_run_length(weight, limit, shift)

    def _next(self, statistic: Array, standardised: Array) -> Array:
        # In units of its standard deviation in the long run, sqrt(weight / (2 - weight)).
        scale = np.sqrt(self.weight * (2 - self.weight))
        return (1 - self.weight) * statistic + scale * standardised


class CUSUM(_Chart):
    """One-sided alarm on the cumulative sum of readings above a reference [1]_.

    Detects lasting increases, at the earliest possible time for a shift of twice the reference.

    Parameters
    ----------
    reference : float, default=0.5
        Reference value in standard deviations of the baseline: half of the shift to be detected.
    limit : float, optional
        Limit of the sum, in standard deviations of the baseline.
    arl : float, optional
        Average run length from which the limit is computed, for a known baseline. Default: 500,
        unless `limit` is given.

    Attributes
    ----------
    mean_, scale_ : ndarray of shape (n_columns,)
        Mean and standard deviation of the baseline. The scale of a constant column is infinite:
        it never gives an alarm.
    limit_ : float
        The limit.
    run_length_ : RunLength
        Readings per false alarm, nominal and for the baseline actually used, with an interval.
    statistic_ : ndarray of shape (n_columns,)
        The present sum.

    See Also
    --------
    emacm.monitoring.EWMA : For shifts in both directions.

    References
    ----------
    .. [1] E. S. Page, Biometrika 41, 100-115, 1954.

    Examples
    --------
    >>> round(CUSUM(0.5, limit=5.0).arl()), round(CUSUM(0.5, limit=5.0).arl(shift=1.0), 1)
    (931, 10.4)
    >>> baseline = np.random.default_rng(3).normal(5.0, 0.5, (100, 1))
    >>> print(CUSUM(0.5, limit=5.0).fit(baseline[:40]).run_length_)  # doctest: +ELLIPSIS
    nominal: 931 readings per false alarm if the baseline were known and readings independent; ...
    """

    def __init__(
        self, reference: float = 0.5, limit: float | None = None, arl: float | None = None
    ) -> None:
        self.reference = reference
        self.limit = limit
        self.arl = arl

    def _run_length(self, limit: float, shift: float) -> float:
        reference = check_number(self.reference, "reference", at_least=0, at_most=10)
        return run_lengths.cusum_run_length(reference, limit, shift)

    def _next(self, statistic: Array, standardised: Array) -> Array:
        return np.maximum(0.0, statistic + standardised - self.reference)


def _warn_of_drift(X: Array, parts: NDArray[np.intp]) -> None:
    """Warn if a column of a baseline has a trend beyond its autocorrelation.

    1 % of baselines without a trend have a warning.
    """
    probabilities = np.array([trend_probability(column, parts) for column in X.T])
    column = int(np.argmin(probabilities))
    if len(X) >= 10 and probabilities[column] < 0.01 / X.shape[1]:
        warn(
            "drift",
            f"the baseline drifts in column {column} (modified Mann-Kendall test, p = "
            f"{probabilities[column]:.2g}): its mean is not that of the readings to come. Take it "
            f"after the machine has run in; if the rows are not in the order of measurement, sort "
            f"them.",
            stacklevel=3,
        )
