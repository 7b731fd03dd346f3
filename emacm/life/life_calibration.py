"""Models of the remaining life before and after the onset of damage, and their calibration."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from emacm.calibration.left_out import groups_needed, left_out
from emacm.life.life_models import WeibullRegression, WienerProcess
from emacm.recordings.meta import plain_label, read_grouping

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

BEFORE_ONSET = "before onset"
DAMAGE = "damage"
WITHOUT_INDEX = "without index"  # the population at any age, with which intervals are compared
SAME_AGE, EARLIER_AGE = "same age", "earlier age"


@dataclass(frozen=True)
class History:
    """Readings of one unit, by increasing age.

    Attributes
    ----------
    name : object
        Label of the unit.
    rows : ndarray of int, shape (n_readings,)
        Rows of the table.
    ages : ndarray of shape (n_readings,)
        Ages.
    columns : ndarray of shape (n_readings, n_columns)
        Health index and further columns.
    onset : int
        First reading with damage; ``n_readings`` if there is none.
    life : float
        Age at the failure or at the end of the observation, if it is known.
    failed : bool
        Which of the two it is.
    """

    name: Any
    rows: NDArray[np.intp]
    ages: Array
    columns: Array
    onset: int
    life: float = np.inf
    failed: bool = False

    @property
    def damaged(self) -> Bools:
        """Whether there is damage, of each reading."""
        return np.arange(len(self.ages)) >= self.onset

    @property
    def stages(self) -> NDArray[np.str_]:
        """Before the onset or damage, of each reading."""
        return np.where(self.damaged, DAMAGE, BEFORE_ONSET)

    @property
    def onset_age(self) -> float:
        """Age at the onset of damage; infinite if there is none."""
        return float(np.append(self.ages, np.inf)[self.onset])

    @property
    def times(self) -> Array:
        """Age, or time since the onset, of each reading."""
        return np.where(self.damaged, self.ages - self.onset_age, self.ages)

    @property
    def remaining(self) -> Array:
        """Time from each reading to the end."""
        return np.maximum(self.life - self.ages, 0)

    @property
    def running(self) -> Bools:
        """Whether there is damage before the end, of each reading."""
        return self.damaged & (self.remaining > 0)

    @property
    def without_index(self) -> History:
        """The same unit, of which only the age is known."""
        return replace(self, onset=len(self.ages))

    @property
    def states(self) -> Array:
        """Index, time since the onset and increase since then, of each reading with damage."""
        ages, index = self.ages[self.onset :], self.columns[self.onset :, 0]
        return np.column_stack([index, ages - ages[:1], index - index[:1]])


def read_histories(X: Array, groups: Any, onset: float | None, consecutive: int) -> list[History]:
    """Return the history of each unit.

    Parameters
    ----------
    X : ndarray of shape (n_readings, n_columns)
        Age, health index, further columns.
    groups : None or array-like of shape (n_readings,)
        Unit of each reading; None: each reading is of another unit.
    onset : float or None
        Index above which there is damage; None: from the first reading on.
    consecutive : int
        Readings above `onset` in succession that are the onset; fewer if the unit has fewer.

    Raises
    ------
    ValueError
        If two readings of a unit have the same age.
    """
    grouping = read_grouping(groups, X, "groups", "unit")
    labels = np.arange(len(X)) if grouping is None else grouping.labels
    histories = []
    for label in np.unique(labels):
        unit, rows = plain_label(label), np.flatnonzero(labels == label)
        rows = rows[np.argsort(X[rows, 0], kind="stable")]
        ages = X[rows, 0]
        same = np.flatnonzero(np.diff(ages) <= 0)
        if len(same):
            raise ValueError(
                f"unit {unit!r} has two readings at age {ages[same[0]]:g} (rows {rows[same[0]]} "
                f"and {rows[same[0] + 1]}). Average them, or give the units by groups=."
            )
        first = _onset(X[rows, 1:], onset, consecutive)
        histories.append(History(unit, rows, ages, X[rows, 1:], first))
    return histories


def with_lives(histories: list[History], remaining: Array, censored: Any) -> list[History]:
    """Return the histories with the age at the end of each unit, and whether it failed then.

    Raises
    ------
    ValueError
        If age and remaining life of a unit do not add up to the same positive life; or if
        `censored` has another length, or differs between the readings of a unit.
    """
    ended = np.zeros(len(remaining)) if censored is None else np.asarray(censored)
    if ended.shape != remaining.shape or not np.isin(ended, (0, 1)).all():
        raise ValueError(
            f"censored must hold True or False for each of {len(remaining)} readings, got shape "
            f"{ended.shape} of {ended.dtype}."
        )
    units = []
    for unit in histories:
        ends, own = unit.ages + remaining[unit.rows], ended[unit.rows].astype(bool)
        wrong = (np.abs(ends - ends[0]) > 1e-6 * abs(ends[0])) | (ends <= 0)
        if wrong.any():
            row = int(np.argmax(wrong))
            raise ValueError(
                f"age + remaining life of unit {unit.name!r} is {ends[0]:g} in row {unit.rows[0]} "
                f"and {ends[row]:g} in row {unit.rows[row]}. Both must be in the same unit of "
                f"time, and a unit ends once, after 0; a repaired unit is another unit."
            )
        if own.any() != own.all():
            raise ValueError(
                f"censored is True for some readings of unit {unit.name!r} and False for others. "
                f"It says whether the unit failed at the end, and is the same for all of them."
            )
        units.append(replace(unit, life=float(ends[0]), failed=not own[0]))
    return units


def _onset(values: Array, level: float | None, consecutive: int) -> int:
    """Return the first reading with damage, known from it and the readings before it."""
    if not values.shape[1]:
        return len(values)
    above = values[:, 0] > (-np.inf if level is None else level)
    padded = np.append(np.ones(consecutive - 1, dtype=bool), above)
    runs = sliding_window_view(padded, consecutive).all(axis=1)
    return int(np.argmax(np.append(runs, True)))


def check_coverage(coverage: float, n_units: int, what: str = "that failed") -> None:
    """Raise a ValueError if this number of units cannot support a coverage.

    Among n + 1 exchangeable units, the new one has the largest score with probability
    1 / (n + 1); beyond that, intervals say nothing about the data.
    """
    if n_units < groups_needed(coverage):
        raise ValueError(
            f"{n_units} units {what} cannot support intervals of {coverage:.0%} coverage; it "
            f"takes {groups_needed(coverage)}. They support at most {n_units / (n_units + 1):.0%}: "
            f"set coverage to this or less, or add units that were followed until they failed."
        )


def half_width(levels: Array, censored: Bools, coverage: float) -> float:
    """Return how far from the median, in probability, an interval must reach [1]_.

    Among n + 1 exchangeable units, the k-th smallest score of n covers the new one with probability
    k / (n + 1); between these steps, the score is interpolated, so that the coverage is the one
    stated up to terms of the order 1 / n**2 [3]_, and not the next multiple of 1 / (n + 1).

    Parameters
    ----------
    levels : ndarray of shape (n_units,)
        Predicted probability of a life up to the true one (of a censored unit: up to the
        observed one), one for each unit.
    censored : ndarray of bool, shape (n_units,)
        Units that have not failed.
    coverage : float
        Coverage of a further unit.

    Returns
    -------
    float
        Largest ``|level - 0.5|`` of the interval; infinite if the units do not support it.

    Examples
    --------
    >>> units = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.96])
    >>> [round(half_width(units, np.zeros(9, bool), c), 2) for c in (0.8, 0.85, 0.9, 0.91)]
    [0.4, 0.43, 0.46, inf]
    """
    weights = redistributed(levels, censored)
    scores = np.abs(levels - 0.5)
    order = np.argsort(scores, kind="stable")
    order = order[weights[order] > 0]
    reached = np.cumsum(weights[order])
    if not len(order) or coverage > reached[-1] + 1e-9:
        return np.inf
    return float(np.interp(coverage, np.append(0.0, reached), np.append(0.0, scores[order])))


def redistributed(levels: Array, censored: Bools) -> Array:
    """Return the weight of each unit; the new unit, which may be anywhere, has the rest to 1.

    The weight 1 / (n + 1) of a censored unit is given to the units with larger levels and to the
    new one, in equal parts [4]_.

    Examples
    --------
    >>> redistributed(np.array([0.2, 0.5, 0.8]), np.array([False, True, False])).tolist()
    [0.25, 0.0, 0.375]
    """
    # This is the Kaplan-Meier estimate: at equal levels, failures come before censored units.
    order = np.lexsort((censored, levels))
    at_risk = np.arange(len(levels), 0, -1) + 1
    surviving = np.cumprod(np.append(1.0, 1 - ~censored[order] / at_risk))
    weights = np.empty(len(levels))
    weights[order] = surviving[:-1] - surviving[1:]
    return weights


def outside_fit(X: Array, fitted: Array, *, margin: float = 0.0) -> list[str]:
    """State for each reading what of it is outside the range of the fit.

    Parameters
    ----------
    X : ndarray of shape (n_readings, n_columns)
        Age, health index, further columns.
    fitted : ndarray of shape (2, n_columns)
        Lowest and highest of each column in the fit; of the age: 0 and the longest life.
    margin : float
        Distance beyond the range that is not stated, relative to its width.

    Returns
    -------
    list of str
        An empty string for a reading that is inside.
    """
    names = ["age", "health index", *(f"column {k}" for k in range(2, X.shape[1]))]
    low, high = fitted
    near = np.clip(X, low - margin * (high - low), high + margin * (high - low))
    statements = []
    for values, outside in zip(X, near != X, strict=True):
        found = [
            f"The {names[k]} {values[k]:g} is outside that of the fit, {low[k]:g} to {high[k]:g}."
            for k in np.flatnonzero(outside)
        ]
        statements.append(" ".join([*found, "Check the units of measurement."] if found else []))
    return statements


def statement(row: dict[str, Any], coverage: float, without_index: Array) -> str:
    """Say what an interval is based on.

    Parameters
    ----------
    row : dict
        Its row in the table of `RemainingLife.predict_interval`.
    coverage : float
        Its coverage.
    without_index : ndarray of shape (2,)
        Lower and upper limit from the age alone.
    """
    basis, when = "No damage is known: this is the life of the population.", "of this age"
    if row["stage"] == DAMAGE:
        basis = "Damage is present: this follows from health index, and age if no onset was seen."
        when = "as long after the onset"
    interval = f"{coverage:.0%} interval from {row['n_units']} units {when}."
    if not np.isfinite(row["upper"]):
        interval = f"The units do not support an upper limit with {coverage:.0%} coverage."
    elif row["calibration"] != SAME_AGE:
        units = f"{row['n_units']} units earlier"
        interval = f"{coverage:.0%} interval as of {units}: too few {when}."
    low, high = without_index
    if row["stage"] == DAMAGE and row["upper"] - row["lower"] > high - low:
        interval += f" It is wider than the one from the age alone, {low:.3g} to {high:.3g}."
    return f"{basis} {interval}"


@dataclass(frozen=True)
class LifeModels:
    """Life of the population, and remaining life after the onset of damage.

    Attributes
    ----------
    population : WeibullRegression
        Used before the onset.
    damage : WeibullRegression, WienerProcess or None
        Used from the onset on; None if no unit of the fit had damage.
    readings : WeibullRegression or None
        Remaining life of all readings, whatever their columns are; with it, the age counts beside
        the columns of units whose onset is their first reading.
    """

    population: WeibullRegression
    damage: WeibullRegression | WienerProcess | None
    readings: WeibullRegression | None = None

    @classmethod
    def fit(cls, histories: list[History], model: str, threshold: float | None) -> LifeModels:
        """Estimate them from whole units, which count equally."""
        lives = np.array([unit.life for unit in histories])
        failed = np.array([unit.failed for unit in histories])
        no_columns, once = np.zeros((len(histories), 0)), np.ones(len(histories))
        population = WeibullRegression.fit(no_columns, lives, failed, once)
        damaged = [unit for unit in histories if unit.damaged.any()]
        if not damaged:
            return cls(population, None)
        if model == "wiener":
            if threshold is None:
                threshold = float(np.mean([x.columns[-1, 0] for x in damaged if x.failed]))
            paths = [(unit.ages[unit.onset :], unit.states[:, 0]) for unit in damaged]
            return cls(population, WienerProcess.fit(paths, threshold))
        n_rows = [np.count_nonzero(unit.running) for unit in damaged]
        table = np.concatenate([unit.columns[unit.running] for unit in damaged])
        remaining = np.concatenate([unit.remaining[unit.running] for unit in damaged])
        failed = np.repeat([unit.failed for unit in damaged], n_rows)
        weights = np.repeat(1 / np.maximum(n_rows, 1), n_rows)
        damage = WeibullRegression.fit(table, remaining, failed, weights)
        readings = WeibullRegression.fit(table[:, :0], remaining, failed, weights)
        return cls(population, damage, readings)

    def cdf(self, unit: History, remaining: Array) -> Array:
        """Return the probability of remaining lives, (n_readings, n_levels), of each reading."""
        probabilities = self._without_age(unit, remaining)
        for row, (steps, given_age) in self._given_age(unit):
            probabilities[row] = np.interp(probabilities[row], steps, given_age)
        return probabilities

    def _given_age(self, unit: History) -> Iterator[tuple[int, tuple[Array, Array]]]:
        """Yield for each reading steps of the probability given its columns, and given the age too.

        Bayes' rule: the prior is the life of the population that survived to this age, and the
        columns have the likelihood p(remaining life | columns) / p(remaining life), so that columns
        without information leave the prior. Where the onset was seen, the columns decide alone.
        """
        if unit.onset or self.readings is None or not isinstance(self.damage, WeibullRegression):
            return
        n_steps = 400
        logs = self.damage.logs_at((np.arange(n_steps) + 0.5) / n_steps, unit.columns)
        with np.errstate(divide="ignore"):
            ages = np.log(unit.ages[:, np.newaxis])
        weights = self.population.log_density(np.logaddexp(ages, logs))
        weights -= self.readings.log_density(logs)
        weights = np.exp(weights - weights.max(axis=1, keepdims=True))
        for row, own in enumerate(weights):
            passed = np.append(0.0, np.cumsum(own))
            yield row, (np.linspace(0, 1, n_steps + 1), passed / passed[-1])

    def _without_age(self, unit: History, remaining: Array) -> Array:
        first = unit.onset
        probabilities = np.empty(remaining.shape)
        no_columns, ages = unit.columns[:first, np.newaxis, :0], unit.ages[:first, np.newaxis]
        probabilities[:first] = self.population.cdf(remaining[:first], no_columns, ages)
        if self.damage is not None:
            wiener = isinstance(self.damage, WienerProcess)
            table = unit.states if wiener else unit.columns[first:]
            probabilities[first:] = self.damage.cdf(remaining[first:], table[:, np.newaxis, :])
        return probabilities

    def quantiles(self, unit: History, levels: Array) -> Array:
        """Return the remaining lives with these probabilities, (n_readings, n_levels)."""
        given = levels.copy()
        for row, (steps, given_age) in self._given_age(unit):
            given[row] = np.interp(levels[row], given_age, steps)
        low = np.full(levels.shape, self.population.intercept - 25.0)
        high = low + 50.0
        for _ in range(45):  # to 1e-12 of the life
            middle = (low + high) / 2
            below = self._without_age(unit, np.exp(middle)) < given
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        lives = np.where(levels <= 0, 0.0, np.exp(high))
        return np.where(levels >= 1, np.inf, lives)


class Levels(NamedTuple):
    """Predicted probability of a life up to the true one, of a unit left out of the fit.

    Attributes
    ----------
    times : ndarray of shape (n_readings,)
        Age, or time since the onset.
    levels : ndarray of shape (n_readings,)
        Probabilities.
    end : float
        Time at which this stage ends: onset, failure or end of the observation.
    censored : bool
        Whether the unit has not failed.
    """

    times: Array
    levels: Array
    end: float
    censored: bool


class LifeCalibration:
    """Levels of left-out units, from which the width of an interval follows.

    Parameters
    ----------
    histories : list of History
        All units, with their lives.
    fit : callable
        Returns models fitted on some of the units.
    """

    def __init__(
        self, histories: list[History], fit: Callable[[list[History]], LifeModels]
    ) -> None:
        self.units: dict[str, list[Levels]] = {BEFORE_ONSET: [], DAMAGE: [], WITHOUT_INDEX: []}
        numbers = np.arange(len(histories))
        for others, rows in left_out(np.zeros_like(numbers), numbers):
            models = fit([histories[k] for k in others])
            for k in rows:
                self._add(models, histories[k])

    def width(self, stage: str, time: float, coverage: float) -> tuple[float, int, str]:
        """Return half the width of an interval in probability, units used, and calibration."""
        width, n_units = self._width_at(stage, time, coverage)
        if np.isfinite(width):
            return width, n_units, SAME_AGE
        # The latest time before that enough units reached.
        for end in sorted({unit.end for unit in self.units[stage] if unit.end <= time})[::-1]:
            width, n_units = self._width_at(stage, np.nextafter(end, 0), coverage)
            if np.isfinite(width):
                break
        return width, n_units, EARLIER_AGE

    def _width_at(self, stage: str, time: float, coverage: float) -> tuple[float, int]:
        alive = [unit for unit in self.units[stage] if time < unit.end]
        levels = np.array([np.interp(time, unit.times, unit.levels) for unit in alive])
        censored = np.array([unit.censored for unit in alive], dtype=bool)
        return half_width(levels, censored, coverage), len(alive)

    def _add(self, models: LifeModels, unit: History) -> None:
        new = unit.without_index
        for stage, known, rows, end in (
            (BEFORE_ONSET, unit, ~unit.damaged, min(unit.onset_age, unit.life)),
            (DAMAGE, unit, unit.running, unit.life - unit.onset_age),
            (WITHOUT_INDEX, new, unit.remaining > 0, unit.life),
        ):
            if rows.any():
                levels = models.cdf(known, unit.remaining[:, np.newaxis])[:, 0]
                one = Levels(known.times[rows], levels[rows], end, not unit.failed)
                self.units[stage].append(one)
