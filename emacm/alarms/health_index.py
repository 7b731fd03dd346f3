"""Health index: distance of feature rows from healthy recordings, with limits and trends."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.stats import t as student
from sklearn.base import TransformerMixin
from sklearn.covariance import LedoitWolf
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_is_fitted, validate_data

from emacm._checks import check_choice, check_number, check_table, located
from emacm._saved import SavedEstimator
from emacm._statements import warn
from emacm.alarms.stationarity import instability
from emacm.calibration.left_out import grouped_quantile, groups_needed, left_out
from emacm.recordings.inputs import as_list, paths_or_numbers
from emacm.recordings.meta import read_grouping, read_meta


def health_trend(model: Any, recordings: Any, *, unit: Any = None, time: Any) -> pd.DataFrame:
    """Return the trend of each unit from recordings; one that is invalid is a row with its error.

    Parameters
    ----------
    model : Pipeline
        Fitted on healthy recordings; ends in a `HealthIndex`. Its other steps turn recordings into
        features.
    recordings : sequence of Recording
        Such as a `RecordingFolder`; they are read one by one.
    unit : key of meta, tuple of keys, callable or array-like, optional
        The unit of each recording. Default: all are of one unit, compared with the population.
    time : key of meta, callable or array-like
        Time of each recording: dates, or numbers such as hours or cycles.

    Returns
    -------
    DataFrame
        Sorted by unit and time: "unit", "time", "index", "limit", "alarm" (whether it exceeds the
        limit), "false_alarm" (the rate of the limit), "baseline" ("unit" or "population"),
        "recording" (path, or number in `recordings`) and "error" (empty if there is none); rows
        with an error have no index and no alarm.

    Raises
    ------
    TypeError, ValueError
        If `model` is no such pipeline, units or times are invalid, or there are too few groups for
        the limit.

    See Also
    --------
    emacm.monitoring.HealthIndex : The index.

    Examples
    --------
    >>> from emacm import OrderPSD, OrderResampler, Recording
    >>> from sklearn.pipeline import make_pipeline
    >>> rng = np.random.default_rng(0)
    >>> runs = [
    ...     Recording({"vib": level * rng.normal(size=4000)}, 1000, velocity=100.0, meta={"day": k})
    ...     for k, level in enumerate(12 * [1.0] + [1.5, 2.0])
    ... ]
    >>> index = HealthIndex(false_alarm=0.1)
    >>> model = make_pipeline(OrderResampler(2 * np.pi / 16), OrderPSD(0.25), index)
    >>> model = model.fit(runs[:12], healthindex__groups=range(12))
    >>> health_trend(model, runs[10:], time="day")["alarm"].tolist()
    [False, False, True, True]
    """
    if not isinstance(model, Pipeline) or not isinstance(model[-1], HealthIndex):
        raise TypeError(
            f"model must be a Pipeline that ends in a HealthIndex, got {type(model).__name__}."
        )
    index: HealthIndex = model[-1]
    check_is_fitted(index)
    entries = as_list(recordings)
    units = ["all"] * len(entries)
    if unit is not None:
        units = read_meta(entries, unit, role="unit", arrays=True)
    times = read_meta(entries, time, role="time", arrays=True)
    read_grouping(times, units, "times", "time")  # refuses times without an order
    values, errors = np.full(len(entries), np.nan), [""] * len(entries)
    for k, entry in enumerate(entries):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                values[k] = index.transform(model[:-1].transform([entry]), units[k : k + 1])[0, 0]
        except Exception as error:  # whatever it is, it is the result for this recording
            errors[k] = " ".join(str(error).split()) or type(error).__name__
    table = pd.DataFrame({"unit": units, "time": times, "index": values})
    known = {unit for unit, value in zip(units, values, strict=True) if np.isfinite(value)}
    limits = {unit: index.limit(unit) for unit in known}
    table["limit"] = [limits.get(unit, np.nan) for unit in units]
    table["alarm"] = table["index"] > table["limit"]
    table["false_alarm"] = index.false_alarm
    table["baseline"] = [_UNIT if unit in index.units_ else _POPULATION for unit in units]
    table["recording"], table["error"] = paths_or_numbers(entries), errors
    return table.sort_values(["unit", "time"], kind="stable", ignore_index=True)


Array = NDArray[np.float64]

_UNIT, _POPULATION = "unit", "population"  # kinds of baselines


class HealthIndex(TransformerMixin, SavedEstimator):
    """Distance of recordings from healthy ones, in usual distances of healthy recordings.

    It is fitted on healthy recordings only and needs no faults. The distance is that of
    Mahalanobis, divided by the square root of the number of features: healthy recordings are about
    1 away. A unit with five healthy recordings or more in `fit` is compared with its own mean; any
    other with the mean of all units, whose differences then count as usual.

    Parameters
    ----------
    false_alarm : float, default=0.05
        Probability that a healthy recording exceeds the limit.
    few_groups : {"refuse", "log-normal"}
        With fewer groups than `false_alarm` needs: the limit is refused; or the logarithm of the
        largest index of a group is taken to be normal, and the limit is its prediction limit.

    Attributes
    ----------
    units_ : tuple
        Units with a baseline of their own.
    left_out_ : DataFrame
        Index of each recording that was left out together with its group, or its whole unit, from
        which the limits are computed: columns "row" (number in X), "group", "baseline" ("unit" or
        "population") and "index".
    n_features_in_ : int
        Number of features.
    feature_names_in_ : ndarray of str
        Their names, if they have any.

    See Also
    --------
    emacm.monitoring.health_trend : Its trend for each unit.
    emacm.monitoring.EWMA : Alarms on the index.

    Notes
    -----
    Limits are quantiles of `left_out_` in which each group counts the same and one more group is
    taken to be beyond all: ``sum over groups of fraction <= limit`` is at least (1 - false_alarm)
    (n_groups + 1), as in [1]_. They need no normal distribution, and at least 1 / false_alarm - 1
    groups: 19 for 5 %, 99 for 1 %. The rate holds on average over sets of training groups that are
    exchangeable with the new ones. For units with a baseline, a group of recordings of the unit is
    left out; for others, a whole unit.

    For fewer groups, ``few_groups="log-normal"`` sets the limit ``exp(m + t s sqrt(1 + 1 / n))``
    from mean m and deviation s of n logarithms, with the quantile 1 - false_alarm of Student's t
    for n - 1 degrees of freedom [2]_. Of new recordings, 0 to 4 % exceeded that of 5 % (3 to 18
    groups of 3, 3 to 30 features, normal or Student's t with 4 degrees of freedom, alike or
    correlated within a group; ``benchmarks/stated_limits.py``).

    The groups, in their order, must be exchangeable. Where successive ones are alike, with a
    correlation of 0.6, 14 to 44 % of healthy recordings exceeded a limit of 5 % (20 simulated
    groups of 4 and 24 features), and with 0.8, 38 to 89 %. `fit` therefore warns of a drift
    (modified Mann-Kendall test) and of a correlation of at least 0.2 (`emacm.alarms.stationarity`),
    and does so without need for 1 % of the baselines. Of bearings that run in (PRONOSTIA; 20
    records in 33 minutes as the baseline, 24 levels of bands and 2 of channels), the median one
    exceeded the limit in 39 % of the first half of its life (7 bearings, on which the 0.2 was
    chosen; 6 of them with a warning, the other 11 %) and in 61 % (7 others; 5 with a warning, the
    other two 83 and 90 %: what changes after the baseline is not in it).

    Rows of `fit` are closer to their own mean: of charts with a baseline of 20 rows (`CUSUM` 0.5
    with limit 5, 4 and 24 features), 73 and 100 % gave a false alarm within 200 healthy readings,
    and 27 and 31 % with `left_out_` (``benchmarks/stated_limits.py``).

    Covariances are estimated with the shrinkage of Ledoit and Wolf, of standardised features.
    Features that are constant in the healthy recordings are not used. Powers should be logarithms.

    References
    ----------
    .. [1] Lee, Barber and Willett, Distribution-free inference with hierarchical data, 2023,
       arXiv:2306.06342, section 3. Here each group is left out of the fit in its turn.
    .. [2] Hahn and Meeker, Statistical Intervals, 1991, section 4.8 (one-sided prediction bound).

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> healthy = rng.normal(size=(60, 3))
    >>> index = HealthIndex(false_alarm=0.1).fit(healthy, groups=np.arange(60) // 3)
    >>> index.transform([[0.5, -0.2, 0.1], [9.0, 0.0, 0.0]]).round(1).ravel().tolist()
    [0.4, 4.7]
    >>> round(index.limit(), 2)
    1.49
    """

    def __init__(self, false_alarm: float = 0.05, *, few_groups: str = "refuse") -> None:
        self.false_alarm = false_alarm
        self.few_groups = few_groups

    def fit(
        self, X: Any, y: Any = None, groups: ArrayLike | None = None, units: ArrayLike | None = None
    ) -> HealthIndex:
        """Learn the baselines, and leave out groups and units to learn the limits.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features of healthy recordings, in the order in which they were measured.
        y : ignored
        groups : array-like of shape (n_recordings,), optional
            Recordings that were measured together (run, day). Default: single recordings are left
            out, with a warning.
        units : array-like of shape (n_recordings,), optional
            Unit of each recording. Default: all are of one population, without own baselines.

        Returns
        -------
        HealthIndex
            Itself.

        Raises
        ------
        TypeError, ValueError
            If X, a label or a parameter is invalid, or there are fewer than two recordings.

        Warns
        -----
        EmacmWarning
            Without `groups`; if the groups, in their order, are not exchangeable: a drift or
            a correlation of successive ones.
        """
        check_number(self.false_alarm, "false_alarm", above=0, below=1)
        check_choice(self.few_groups, "few_groups", ("refuse", "log-normal"))
        check_table(X)
        X = validate_data(self, X, dtype=np.float64, ensure_min_samples=2)
        if groups is None:
            warn(
                "groups",
                "without groups, single recordings are left out: near-duplicates, such as parts of "
                "one run, then make the limits too low. Pass groups=, such as the run.",
                stacklevel=2,
            )
        own = None if units is None else _labels(X, units, "units")
        blocks = _labels(X, range(len(X)) if groups is None else groups, "groups")
        self._baselines = known = _Baselines.of(X, own)
        if not known.total.any() or (known.means and not known.within.any()):
            raise ValueError(
                "X has no variation in its features, or none within units: are recordings copies?"
            )
        self.units_ = tuple(known.means)
        population = blocks if own is None else own
        found = [_left_out_indices(X, own, population, _POPULATION)]
        if own is not None:
            pairs = pd.Series(list(zip(own, blocks, strict=True)))
            found.append(_left_out_indices(X, own, pairs, _UNIT))
        self.left_out_ = pd.concat(found, ignore_index=True)
        self._fitted_rows = _row_digests(X)
        self._warn_of_drift(X, own, blocks)
        return self

    def transform(self, X: Any, units: ArrayLike | None = None) -> Array:
        """Return the index of recordings.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.
        units : array-like of shape (n_recordings,), optional
            Unit of each recording. Default: all are compared with the population.

        Returns
        -------
        ndarray of shape (n_recordings, 1)
            About 1 for healthy recordings; larger is worse.

        Raises
        ------
        ValueError
            If X or the units are invalid.

        Warns
        -----
        EmacmWarning
            If several rows of `fit` are among X: they are closer to their mean than new ones are.
        """
        check_is_fitted(self)
        check_table(X)
        X = validate_data(self, X, dtype=np.float64, reset=False)
        own = None if units is None else _labels(X, units, "units")
        known = int(np.isin(_row_digests(X), self._fitted_rows).sum())
        if known > 1:  # a single row is no baseline
            warn(
                "rows of fit",
                f"{known} of {len(X)} rows are those of fit, whose index is smaller than that of "
                f"new recordings. As the baseline of a chart, use left_out_['index'], that of "
                f"recordings that were left out.",
                stacklevel=3,
            )
        return self._baselines.distances(X, own)[:, np.newaxis]

    def limit(self, unit: Any = None) -> float:
        """Return the limit of the index of a unit, at `false_alarm`.

        Parameters
        ----------
        unit : label, optional
            The unit; one without a baseline of its own, and None, have the limit of the population.

        Returns
        -------
        float
            The limit.

        Raises
        ------
        ValueError
            If there are too few groups for `false_alarm` (see `few_groups`).
        """
        check_is_fitted(self)
        kind = _UNIT if unit is not None and unit in self.units_ else _POPULATION
        left = self.left_out_[self.left_out_["baseline"] == kind]
        groups, values = pd.factorize(left["group"])[0], left["index"].to_numpy()
        n_groups = len(set(groups))
        if not n_groups:
            raise ValueError(
                "there is no limit, as no healthy group can be left out. Take smaller groups, as "
                "runs, or more healthy recordings; a unit without any needs those of two others, "
                "or name no units (units=, --unit)."
            )
        if self.few_groups == "log-normal" and 1 < n_groups < groups_needed(1 - self.false_alarm):
            largest = np.log(pd.Series(values).groupby(groups).max())
            factor = student.ppf(1 - self.false_alarm, n_groups - 1) * np.sqrt(1 + 1 / n_groups)
            return float(np.exp(largest.mean() + factor * largest.std()))
        share = 1 - self.false_alarm
        remedy = "1 - coverage; raise it, or set few_groups='log-normal'"
        with located(f"limit for a false alarm rate of {self.false_alarm:g} ({remedy})"):
            return grouped_quantile(values, groups, share, name="units or groups", beyond=1)

    def _warn_of_drift(self, X: Array, own: pd.Series | None, blocks: pd.Series) -> None:
        """Warn if the groups, in their order, are not exchangeable, as the limits assume."""
        codes = np.zeros(len(X), np.intp) if own is None else pd.factorize(own)[0]
        means = pd.DataFrame(X).groupby([codes, pd.factorize(blocks)[0]]).mean()
        parts = means.index.get_level_values(0).to_numpy()
        reason = instability(means.to_numpy(), parts)
        if reason:
            warn(
                "drift",
                f"the baseline is not stationary: in the order of the {len(means)} groups, "
                f"{reason}. Healthy recordings will exceed the limits more often than false_alarm, "
                f"up to nearly always. Take the baseline after the machine has run in, over days "
                f"rather than minutes, and pass groups= that are longer than such changes. If the "
                f"rows are not in the order of measurement, sort them.",
                stacklevel=3,
            )

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Return the name of the index, "health_index"."""
        check_is_fitted(self)
        return np.array(["health_index"], dtype=object)


def _labels(X: Array, labels: Any, role: str) -> pd.Series:
    """Return one label for each recording."""
    return pd.Series(read_meta(X, labels, role=role, arrays=True), dtype=object)


def _row_digests(X: Array) -> NDArray[np.uint64]:
    """Return a number for each row, by which it is known again."""
    return pd.util.hash_pandas_object(pd.DataFrame(X), index=False).to_numpy()


@dataclass(frozen=True)
class _Baselines:
    """Means of units and of the population, and factors P with P P' = inverse covariance.

    Attributes
    ----------
    means : dict of unit to (ndarray of shape (n_features,), int)
        Mean and number of recordings, of units with enough of them.
    mean : ndarray of shape (n_features,)
        Mean of the means of all units.
    n_units : int
        Number of units; without units, of recordings.
    within, total : ndarray of shape (n_features, n_features)
        Factors for deviations from the mean of the unit, and from that of the population.
    """

    means: dict[Any, tuple[Array, int]]
    mean: Array
    n_units: int
    within: Array
    total: Array

    @classmethod
    def of(cls, X: Array, units: pd.Series | None) -> _Baselines:
        """Estimate the baselines of healthy recordings."""
        codes, names = pd.factorize(np.arange(len(X)) if units is None else units)
        counts = np.bincount(codes)
        means = pd.DataFrame(X).groupby(codes).mean().to_numpy()
        mean = means.mean(axis=0)
        baselines = {
            name: (means[k], int(counts[k]))
            for k, name in enumerate(names.tolist())
            if counts[k] >= 5  # as in the docstring of HealthIndex
        }
        within = _inverse_root(X - means[codes], X, len(X) - len(names))
        return cls(baselines, mean, len(names), within, _inverse_root(X - mean, X, len(X) - 1))

    def distances(self, X: Array, units: pd.Series | None) -> Array:
        """Return the distance of each row per feature, shape (n_recordings,)."""
        distances = _distances(X, self.mean, self.total, self.n_units)
        if units is None:
            return distances
        codes, names = pd.factorize(units)
        for k, unit in enumerate(names):
            if unit in self.means:
                mean, count = self.means[unit]
                distances[codes == k] = _distances(X[codes == k], mean, self.within, count)
        return distances


def _distances(X: Array, mean: Array, inverse_root: Array, count: int) -> Array:
    """Return distances per feature from a mean of `count` values."""
    squares = np.sum(((X - mean) @ inverse_root) ** 2, axis=1)
    n_used = max(np.count_nonzero(inverse_root.any(axis=1)), 1)
    # A baseline of few recordings is itself uncertain.
    return np.sqrt(squares / n_used / (1 + 1 / count))


def _inverse_root(residuals: Array, X: Array, divisor: int) -> Array:
    """Return P with P P' = inverse of the shrunk covariance of residuals; 0 for constant ones."""
    count, width = residuals.shape
    scale = np.sqrt(np.sum(residuals**2, axis=0) / max(divisor, 1))
    used = scale > 1e-12 * np.abs(X).max(axis=0)
    inverse_root = np.zeros((width, width))
    if divisor < 1 or not used.any():
        return inverse_root
    white = residuals[:, used] / scale[used]
    covariance = LedoitWolf(assume_centered=True).fit(white).covariance_ * count / divisor
    values, vectors = np.linalg.eigh(covariance)
    root = vectors / np.sqrt(np.maximum(values, 1e-9 * values[-1]))
    inverse_root[np.ix_(used, used)] = root / scale[used][:, np.newaxis]
    return inverse_root


def _left_out_indices(
    X: Array, units: pd.Series | None, labels: pd.Series, kind: str
) -> pd.DataFrame:
    """Return the index of each recording by baselines without all recordings of its label."""
    values = np.full(len(X), np.nan)
    for others, rows in left_out(np.zeros(len(X), dtype=np.intp), labels, max_folds=len(X)):
        if len(others) < 2:
            continue
        rest = None if units is None else units.iloc[others]
        baselines = _Baselines.of(X[others], rest)
        own = units.iloc[rows] if units is not None and kind == _UNIT else None
        if own is None or own.iloc[0] in baselines.means:  # else too few are left for a baseline
            values[rows] = baselines.distances(X[rows], own)
    table = pd.DataFrame({"row": range(len(X)), "group": labels, "baseline": kind, "index": values})
    return table.dropna(subset="index")
