"""Remaining life of a unit, with prediction intervals that are valid by unit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from emacm._checks import (
    check_choice,
    check_count,
    check_finite_readings,
    check_number,
    check_table,
    check_unmasked,
)
from emacm._saved import SavedEstimator
from emacm._statements import warn
from emacm.life.life_calibration import (
    WITHOUT_INDEX,
    History,
    LifeCalibration,
    LifeModels,
    check_coverage,
    outside_fit,
    read_histories,
    statement,
    with_lives,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class MaintenanceCosts:
    """Costs of late and early decisions, in one unit of money, and times in the unit of the ages.

    Parameters
    ----------
    failure : float
        Cost of a failure in operation, beyond that of a planned replacement.
    waiting : float
        Cost per time of standing still without a part.
    early : float
        Cost per time of remaining life that is given up by a replacement.
    holding : float
        Cost per time of a part that lies in stock.
    lead_time : float
        Time from the order to the arrival of a part.
    review : float
        Time until the next decision.

    Raises
    ------
    TypeError, ValueError
        If a cost or a time is negative, or `review` is 0.

    See Also
    --------
    emacm.monitoring.RemainingLife : Intervals of the remaining life.

    Examples
    --------
    >>> costs = MaintenanceCosts(
    ...     failure=5000, waiting=100, early=2, holding=1, lead_time=72, review=24
    ... )
    >>> costs.lead_time
    72
    """

    failure: float
    waiting: float
    early: float
    holding: float
    lead_time: float
    review: float

    def __post_init__(self) -> None:
        for name in ("failure", "waiting", "early", "holding", "lead_time"):
            check_number(getattr(self, name), name, at_least=0)
        check_number(self.review, "review", above=0)


def expected_costs(lives: Array, costs: MaintenanceCosts) -> pd.DataFrame:
    """Return the expected cost of each decision.

    Parameters
    ----------
    lives : ndarray of shape (n_readings, n_draws)
        Equally probable remaining lives of each reading.
    costs : MaintenanceCosts
        Costs and times.

    Returns
    -------
    DataFrame
        Columns "continue", "order", "stop" and "decision", the one of least cost.

    Notes
    -----
    With the remaining life R, lead time L and time to the next review H:

    - stop now, order, and replace when the part arrives: waiting L + early E[R];
    - order and continue: failure P(R <= H) + waiting E[(L - R)+] + holding E[(R - L)+];
    - continue, and order at the next review at the earliest: failure P(R <= H) +
      waiting E[(H + L - R)+] + holding E[(R - H - L)+], and if R <= H the part is ordered at
      the failure: waiting L.

    Examples
    --------
    >>> costs = MaintenanceCosts(
    ...     failure=5000, waiting=100, early=2, holding=1, lead_time=72, review=24
    ... )
    >>> expected_costs(np.array([[20.0], [80.0], [5000.0]]), costs)["decision"].tolist()
    ['stop', 'order', 'continue']
    """
    lead, review = costs.lead_time, costs.review
    until_later = np.where(lives <= review, lead, np.maximum(review + lead - lives, 0))
    fails = costs.failure * np.mean(lives <= review, axis=1)
    stop = costs.waiting * lead + costs.early * lives.mean(axis=1)
    stock, missing = np.maximum(lives - lead, 0), np.maximum(lead - lives, 0)
    order = fails + np.mean(costs.waiting * missing + costs.holding * stock, axis=1)
    stock = np.maximum(lives - review - lead, 0)
    later = fails + np.mean(costs.waiting * until_later + costs.holding * stock, axis=1)
    table = pd.DataFrame({"continue": later, "order": order, "stop": stop})
    table["decision"] = table.idxmin(axis=1)
    return table


class RemainingLife(RegressorMixin, SavedEstimator):
    """Predict the remaining life of units from age and health index, with intervals.

    Before the onset of damage only the life of the population is known, given the age reached:
    a Weibull distribution. From the onset on, the health index is used, by one of two models:

    - "weibull": accelerated failure time: the logarithm of the remaining life depends linearly on
      the columns; no threshold is needed. For units with damage from their first reading on
      (without `onset`: all), whose index may say nothing yet, this is combined with the life of the
      population that survived to the present age.
    - "wiener": the index increases by a Wiener process whose drift differs between units and is
      learned for each unit as it is followed; a unit fails when the index reaches a threshold.
      The index should increase linearly: levels in dB do if amplitudes grow exponentially. Index
      and time since the onset decide; the age at the onset does not.

    Units that have not failed (censored) are included. Intervals are calibrated on units left out
    of the fit, each counted once, at the same age or time since the onset.

    Parameters
    ----------
    model : {"weibull", "wiener"}, default="weibull"
        Model of the remaining life after the onset of damage.
    coverage : float, default=0.9
        Fraction of units whose remaining life is to be in the interval, at each age. Refused if
        the number of units that failed does not support it: 9 for 0.9, 19 for 0.95.
    onset : float, optional
        Health index above which there is damage, for example an alarm limit. Default: damage is
        present from the first reading on.
    consecutive : int, default=3
        Successive readings above `onset` that are the onset of damage.
    threshold : float, optional
        Index at which a unit fails, for "wiener". Default: mean of the last index of units that
        failed.

    Attributes
    ----------
    n_units_, n_failed_ : int
        Units in the fit, and those that failed.
    models_ : LifeModels
        Distributions before and after the onset: `population` and `damage`.
    n_features_in_ : int
        Number of columns.

    See Also
    --------
    emacm.monitoring.MaintenanceCosts : Decisions from its intervals.
    emacm.monitoring.coverage_by_unit : Share of lives in the intervals.

    Notes
    -----
    In X, the first column is the age, the second the health index, which increases with damage.
    Further columns are used by "weibull" only. `groups` names the unit of each row: a prediction
    uses the readings of its unit up to its age, and those of no other unit. Without `groups`, each
    row is another unit. Calibration by unit holds for units of the same kind as those of the fit.
    That the fit left out some of its units, and the interpolation between scores, are neglected.

    Coverage of 90 % intervals by unit at ages 50 to 250 h, of 1,000 simulated units predicted from
    fleets of 30 each (``benchmarks/remaining_life.py --trials 1000 --seed 2027``): 90 to 92 % for
    both models, within binomial limits. If a fifth of the units are censored at ages that do not
    depend on their life, 89 to 92 %: limits that they do not support are infinite. Censoring must
    not depend on the life; of units withdrawn at a part of it, 90 to 91 % were covered. Not
    calibrated are readings with "earlier age". At 250 h, where 4 of 10 readings were such, 88 %
    of the units before their onset were covered, and 84 % with censored units.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> units = np.repeat(np.arange(30), 20)
    >>> rates = rng.uniform(0.8, 1.4, 30)[units]  # index per hour; units fail at an index of 10
    >>> lives = 10 / rates
    >>> ages = np.tile(np.arange(20) / 20, 30) * lives
    >>> X = np.column_stack([ages, ages * rates])
    >>> model = RemainingLife("wiener", threshold=10.0).fit(X, lives - ages, groups=units)
    >>> model.predict([[4.0, 5.0]]).round(0)
    array([5.])
    """

    def __init__(
        self,
        model: str = "weibull",
        *,
        coverage: float = 0.9,
        onset: float | None = None,
        consecutive: int = 3,
        threshold: float | None = None,
    ) -> None:
        self.model = model
        self.coverage = coverage
        self.onset = onset
        self.consecutive = consecutive
        self.threshold = threshold

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.positive_only = True  # ages are not negative
        tags.target_tags.positive_only = True
        tags.regressor_tags.poor_score = True  # random columns say nothing about a life
        return tags

    def fit(
        self,
        X: Any,
        y: ArrayLike,
        *,
        groups: ArrayLike | None = None,
        censored: ArrayLike | None = None,
    ) -> Self:
        """Estimate the distributions, and calibrate the intervals on left-out units.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_readings, n_columns)
            Age, health index, further columns.
        y : array-like of shape (n_readings,)
            Remaining life; of a unit that has not failed, time to the end of its observation.
        groups : array-like of shape (n_readings,), optional
            Unit of each reading. Default: each reading is of another unit.
        censored : array-like of bool, shape (n_readings,), optional
            Whether the unit of a reading has not failed. Default: all failed.

        Returns
        -------
        Self
            Itself.

        Raises
        ------
        TypeError, ValueError
            If X, y or a parameter is invalid, age and remaining life of a unit do not add up to
            the same life, or the number of units that failed does not support the coverage.
        """
        self._check_parameters()
        options: Any = {"dtype": np.float64, "ensure_all_finite": False}
        check_table(X)
        check_unmasked(y, "y")
        X, y = validate_data(self, X, y, y_numeric=True, ensure_min_samples=2, **options)
        y = np.asarray(y, dtype=np.float64)
        self._check_values(X)
        if (y < 0).any():
            row = int(np.argmax(y < 0))
            raise ValueError(f"y must not be negative, got {y[row]:g} in row {row}.")
        histories = read_histories(X, groups, self.onset, self.consecutive)
        histories = with_lives(histories, y, censored)
        failed = [unit for unit in histories if unit.failed]
        self.n_units_, self.n_failed_ = len(histories), len(failed)
        check_coverage(self.coverage, self.n_failed_)
        if self.n_features_in_ > 1:
            what = f"that failed and have readings after the onset of damage (onset={self.onset!r})"
            check_coverage(self.coverage, len([x for x in failed if x.damaged.any()]), what)
        fit = partial(LifeModels.fit, model=self.model, threshold=self.threshold)
        self.models_ = fit(histories)
        self._fitted_range = np.array([X.min(axis=0), X.max(axis=0)])
        self._fitted_range[:, 0] = 0, max(unit.life for unit in histories)
        self._calibration = LifeCalibration(histories, fit)
        return self

    def predict(self, X: Any, groups: ArrayLike | None = None) -> Array:
        """Return the median of the remaining life of each reading.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_readings, n_columns)
            Columns as in `fit`.
        groups : array-like of shape (n_readings,), optional
            Unit of each reading. Default: each reading is of another unit.

        Returns
        -------
        ndarray of shape (n_readings,)
            Medians, in the unit of y.
        """
        return self._predicted(X, groups, np.array([0.5]))[:, 0]

    def predict_interval(
        self, X: Any, groups: ArrayLike | None = None, *, coverage: float | None = None
    ) -> pd.DataFrame:
        """Return prediction intervals whose coverage holds by unit.

        Parameters
        ----------
        X, groups
            As for `predict`.
        coverage : float, optional
            Default: that of the estimator.

        Returns
        -------
        DataFrame
            One row per reading: "age", "stage" ("before onset": only the life of the population is
            known; "damage"), "median", "lower" and "upper" (which may be infinite), "n_units"
            (units on which the interval is calibrated), "calibration" ("same age": on units of the
            same age or time since the onset; "earlier age": too few units reached it, so that the
            interval is as wide as at the latest one that enough units reached) and "statement", in
            words, also of an age or an index outside the range of the fit, and of an interval that
            is wider than the one from the age alone.

        Raises
        ------
        ValueError
            If the number of units does not support the coverage, and as for `predict`.
        """
        check_is_fitted(self)
        coverage = self.coverage if coverage is None else coverage
        check_number(coverage, "coverage", above=0, below=1)
        check_coverage(coverage, self.n_failed_)
        index = X.index if isinstance(X, pd.DataFrame) else None
        X, units = self._followed(X, groups)
        calibrated: list[Any] = [None] * len(X)
        for unit in units:
            for row, stage, time in zip(unit.rows, unit.stages, unit.times, strict=True):
                calibrated[row] = stage, *self._calibration.width(stage, time, coverage)
        stages, widths, n_units, calibration = zip(*calibrated, strict=True)
        table = pd.DataFrame({"age": X[:, 0], "stage": stages}, index)
        levels = np.column_stack([np.zeros(len(X)), np.negative(widths), widths])
        table[["median", "lower", "upper"]] = self._quantiles(units, np.clip(0.5 + levels, 0, 1))
        table["n_units"], table["calibration"] = n_units, calibration
        rows, outside = table.to_dict("records"), outside_fit(X, self._fitted_range)
        without = np.empty((len(X), 2))
        for unit in units:
            wide = [self._calibration.width(WITHOUT_INDEX, x, coverage)[0] for x in unit.ages]
            limits = np.clip(0.5 + np.outer(wide, [-1, 1]), 0, 1)
            without[unit.rows] = self.models_.quantiles(unit.without_index, limits)
        table["statement"] = [
            f"{statement(row, coverage, plain)} {text}".rstrip()
            for row, plain, text in zip(rows, without, outside, strict=True)
        ]
        return table

    def decide(
        self, X: Any, costs: MaintenanceCosts, groups: ArrayLike | None = None
    ) -> pd.DataFrame:
        """Return the decision of least expected cost for each reading.

        Parameters
        ----------
        X, groups
            As for `predict`.
        costs : MaintenanceCosts
            What late and early decisions cost.

        Returns
        -------
        DataFrame
            Expected costs "continue", "order" and "stop", and "decision", the least of them.

        Raises
        ------
        TypeError
            If `costs` is no `MaintenanceCosts`.
        """
        if not isinstance(costs, MaintenanceCosts):
            raise TypeError(f"costs must be MaintenanceCosts, got {type(costs).__name__}.")
        levels = (np.arange(200) + 0.5) / 200  # equally probable lives, to average costs over
        table = expected_costs(self._predicted(X, groups, levels), costs)
        return table.set_axis(X.index) if isinstance(X, pd.DataFrame) else table

    def _check_parameters(self) -> None:
        check_choice(self.model, "model", ("weibull", "wiener"))
        check_number(self.coverage, "coverage", above=0, below=1)
        check_count(self.consecutive, "consecutive")
        if self.onset is not None:
            check_number(self.onset, "onset")
        if self.threshold is not None:
            onset = self.onset if self.model == "wiener" else None
            check_number(self.threshold, "threshold", above=onset)

    def _followed(self, X: Any, groups: Any) -> tuple[Array, list[History]]:
        check_is_fitted(self)
        check_table(X)
        X = validate_data(self, X, dtype=np.float64, ensure_all_finite=False, reset=False)
        self._check_values(X)
        return X, read_histories(X, groups, self.onset, self.consecutive)

    def _check_values(self, X: Array) -> None:
        check_finite_readings(X, self)
        if (X[:, 0] < 0).any():
            row = int(np.argmax(X[:, 0] < 0))
            raise ValueError(
                f"Negative values in data passed to X: the first column is the age, got "
                f"{X[row, 0]:g} in row {row}."
            )

    def _predicted(self, X: Any, groups: Any, levels: Array) -> Array:
        """Return quantiles of the predicted distribution, (n_readings, n_levels)."""
        X, units = self._followed(X, groups)
        texts = outside_fit(X, self._fitted_range, margin=0.1)
        rows = [row for row, text in enumerate(texts) if text]
        if rows:
            warn(
                "extrapolation",
                f"{len(rows)} of {len(X)} readings are far outside the range of the fit, where "
                f"predictions extrapolate; row {rows[0]}: {texts[rows[0]]}",
                stacklevel=3,
            )
        return self._quantiles(units, np.broadcast_to(levels, (len(X), len(levels))))

    def _quantiles(self, units: list[History], levels: Array) -> Array:
        quantiles = np.empty(levels.shape)
        for unit in units:
            quantiles[unit.rows] = self.models_.quantiles(unit, levels[unit.rows])
        return quantiles
