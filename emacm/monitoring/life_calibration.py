"""Models of the remaining life before and after the onset of damage, and their calibration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm.monitoring.conformal_units import half_width
from emacm.monitoring.life_models import WeibullLife, WeibullRegression, WienerProcess
from emacm.monitoring.unit_histories import History

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

BEFORE_ONSET = "before onset"
DAMAGE = "damage"
MODELS = ("weibull", "wiener")
SAME_AGE, EARLIER_AGE = "same age", "earlier age"
_MOST_FOLDS = 20  # units are left out one by one up to this number, else in this many folds
_N_HALVINGS = 60


@dataclass(frozen=True)
class LifeModels:
    """Life of the population, and remaining life after the onset of damage.

    Attributes
    ----------
    population : WeibullLife
        Used before the onset.
    damage : WeibullRegression, WienerProcess or None
        Used from the onset on; None if no unit of the fit had damage.
    """

    population: WeibullLife
    damage: WeibullRegression | WienerProcess | None

    @classmethod
    def fit(
        cls,
        histories: list[History],
        lives: Array,
        failed: Bools,
        model: str,
        threshold: float | None,
    ) -> LifeModels:
        """Estimate both from whole units, which count equally."""
        population = WeibullLife.fit(lives, failed)
        chosen = [k for k, unit in enumerate(histories) if unit.onset < len(unit.ages)]
        if not chosen:
            return cls(population, None)
        if model == "wiener":
            paths = [
                (histories[k].ages[histories[k].onset :], histories[k].states[:, 0]) for k in chosen
            ]
            return cls(population, WienerProcess.fit(paths, failed[chosen], threshold))
        parts = []
        for k in chosen:
            unit = histories[k]
            left = lives[k] - unit.ages[unit.onset :]
            running = left > 0
            n = int(running.sum())
            columns = unit.columns[unit.onset :][running]
            parts.append((columns, left[running], np.full(n, failed[k]), np.full(n, 1 / max(n, 1))))
        table, remaining, ends, weights = map(np.concatenate, zip(*parts, strict=True))
        return cls(population, WeibullRegression.fit(table, remaining, ends, weights))

    def cdf(self, unit: History, remaining: Array) -> Array:
        """Return the probability of remaining lives, (n_readings, n_levels), of each reading."""
        first = unit.onset
        found = np.empty(remaining.shape)
        found[:first] = self.population.cdf(remaining[:first], unit.ages[:first, np.newaxis])
        if first < len(unit.ages):
            if self.damage is None:
                raise ValueError("no unit with damage was in the fit; set another onset.")
            wiener = isinstance(self.damage, WienerProcess)
            table = unit.states if wiener else unit.columns[first:]
            found[first:] = self.damage.cdf(remaining[first:], table[:, np.newaxis, :])
        return found

    def quantiles(self, unit: History, levels: Array) -> Array:
        """Return the remaining lives with these probabilities, (n_readings, n_levels)."""
        low = np.full(levels.shape, np.log(self.population.scale) - 25.0)
        high = low + 50.0
        for _ in range(_N_HALVINGS):
            middle = (low + high) / 2
            below = self.cdf(unit, np.exp(middle)) < levels
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
    failed : bool
        Whether the unit failed.
    """

    times: Array
    levels: Array
    end: float
    failed: bool


class LifeCalibration:
    """Levels of left-out units, from which the width of an interval follows.

    Parameters
    ----------
    histories : list of History
        All units.
    lives : ndarray of shape (n_units,)
        Age at the failure or at the end of the observation.
    failed : ndarray of bool, shape (n_units,)
        Which of the two it is.
    fit : callable
        Models fitted on some of the units.
    """

    def __init__(
        self,
        histories: list[History],
        lives: Array,
        failed: Bools,
        fit: Callable[[NDArray[np.intp]], LifeModels],
    ) -> None:
        self.units: dict[str, list[Levels]] = {BEFORE_ONSET: [], DAMAGE: []}
        folds = np.arange(len(histories)) % min(_MOST_FOLDS, len(histories))
        for fold in range(int(folds.max()) + 1):
            models = fit(np.flatnonzero(folds != fold))
            for k in np.flatnonzero(folds == fold):
                self._add(models, histories[k], lives[k], bool(failed[k]))

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
        censored = np.array([not unit.failed for unit in alive], dtype=bool)
        return half_width(levels, censored, coverage), len(alive)

    def _add(self, models: LifeModels, unit: History, life: float, failed: bool) -> None:
        left = np.maximum(life - unit.ages, 0)
        levels = models.cdf(unit, left[:, np.newaxis])[:, 0]
        first = unit.onset
        if first > 0:
            end = unit.ages[first] if first < len(unit.ages) else life
            stage = Levels(unit.ages[:first], levels[:first], float(end), failed)
            self.units[BEFORE_ONSET].append(stage)
        running = (np.arange(len(left)) >= first) & (left > 0)
        if running.any():
            times = unit.ages[running] - unit.ages[first]
            end = float(life - unit.ages[first])
            self.units[DAMAGE].append(Levels(times, levels[running], end, failed))
