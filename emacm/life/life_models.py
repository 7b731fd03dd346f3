"""Distributions of the remaining life: population, Wiener process, accelerated failure time.

Each model gives the cumulative distribution function of the remaining life of a reading; what is
common to all is in `emacm.life.remaining_life.RemainingLife`.

References
----------
.. [1] X.-S. Si et al., A Wiener-process-based degradation model with a recursive filter algorithm
   for remaining useful life estimation, Mech. Syst. Signal Process. 35, 219-237, 2013.
.. [2] W. Q. Meeker and L. A. Escobar, Statistical Methods for Reliability Data, Wiley, 1998,
   chapters 8 and 17.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import erfcx, ndtr

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WeibullRegression:
    """Weibull accelerated failure time: log life = intercept + table @ slopes + spread * error.

    The error has the smallest extreme value distribution [2]_. Lives of the same table have a
    Weibull distribution of shape ``1 / spread`` and scale ``exp(intercept + table @ slopes)``.

    Attributes
    ----------
    intercept, spread : float
        Location and scale of the logarithm of the life.
    slopes : ndarray of shape (n_columns,)
        Change of the logarithm per unit of each column.
    """

    intercept: float
    slopes: Array
    spread: float

    @classmethod
    def fit(
        cls, table: Array, lives: Array, failed: NDArray[np.bool_], weights: Array
    ) -> WeibullRegression:
        """Estimate by maximum likelihood with a small ridge; other lives are censored.

        Parameters
        ----------
        table : ndarray of shape (n_readings, n_columns)
            What the life depends on; without columns, lives have one Weibull distribution.
        lives : ndarray of shape (n_readings,)
            Positive lives, or times under observation.
        failed : ndarray of bool, shape (n_readings,)
            Whether the unit failed at the end of this life.
        weights : ndarray of shape (n_readings,)
            Weight of each reading.
        """
        ridge = 1e-2  # of standardised coefficients: few units give finite ones
        logs, n_columns = np.log(lives), table.shape[1]
        mean = np.average(table, axis=0, weights=weights)
        scale = np.sqrt(np.average((table - mean) ** 2, axis=0, weights=weights))
        scale = np.where(scale > 0, scale, 1.0)
        design = np.column_stack([np.ones(len(logs)), (table - mean) / scale])
        middle = float(np.average(logs, weights=weights))

        def cost(parameters: Array) -> tuple[float, Array]:
            coefficients, log_spread = parameters[:-1], parameters[-1]
            spread = np.exp(log_spread)
            z = (logs - middle - design @ coefficients) / spread
            hazard = np.exp(np.minimum(z, 500.0))
            value = np.sum(weights * (hazard - failed * (z - log_spread)))
            value += ridge * np.sum(coefficients[1:] ** 2)
            slope = weights * (hazard - failed)
            gradient = np.append(
                -(design.T @ slope) / spread, -np.sum(slope * z) + np.sum(weights * failed)
            )
            gradient[1:-1] += 2 * ridge * coefficients[1:]
            return float(value), gradient

        start = np.zeros(n_columns + 2)
        start[-1] = np.log(max(float(logs.std()), 0.1))
        bounds: Any = [(None, None)] * (n_columns + 1)
        bounds.append((-np.log(50.0), 3.0))  # equal lives: no infinite shape
        found = minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds).x
        slopes = found[1:-1] / scale
        return cls(float(middle + found[0] - slopes @ mean), slopes, float(np.exp(found[-1])))

    def cdf(self, remaining: Array, table: Array, ages: Array | float = 0.0) -> Array:
        """Return the probability to fail within a remaining life, at ages reached alive."""
        with np.errstate(divide="ignore"):
            logs = np.log(ages), np.log(ages + remaining)
        location = self.intercept + table @ self.slopes
        passed, hazard = (np.exp(np.minimum((x - location) / self.spread, 500.0)) for x in logs)
        return -np.expm1(passed - hazard)

    def log_density(self, logs: Array) -> Array:
        """Return the log density of lives without columns, up to a constant, from their logs."""
        z = (logs - self.intercept) / self.spread
        return z - np.exp(np.minimum(z, 500.0)) - logs

    def logs_at(self, levels: Array, table: Array) -> Array:
        """Return the logarithms of the lives with these probabilities, (n_readings, n_levels)."""
        location = self.intercept + table @ self.slopes
        return location[:, np.newaxis] + self.spread * np.log(-np.log1p(-levels))


@dataclass(frozen=True)
class WienerProcess:
    """Wiener process with a drift that differs from unit to unit; failure at a threshold [1]_.

    Attributes
    ----------
    threshold : float
        Index at which a unit fails.
    drift, drift_variance : float
        Mean and variance of the drift over units, the conjugate prior of a further unit.
    diffusion : float
        Variance of the increments per unit of time.
    """

    threshold: float
    drift: float
    drift_variance: float
    diffusion: float

    @classmethod
    def fit(cls, paths: list[tuple[Array, Array]], threshold: float) -> WienerProcess:
        """Estimate from the paths of several units, by moments.

        Parameters
        ----------
        paths : list of (ages, index)
            Of each unit, from the onset of damage on.
        threshold : float
            Index at which a unit fails.
        """
        paths = [path for path in paths if len(path[0]) > 1]
        if not paths:
            raise ValueError(
                "no unit has two readings after the onset of damage, so that no drift can be "
                "estimated. Take readings more often, or use model='weibull'."
            )
        times = np.array([ages[-1] - ages[0] for ages, _ in paths])
        drifts = np.array([index[-1] - index[0] for _, index in paths]) / times
        squares = n_steps = 0.0
        for (ages, index), drift in zip(paths, drifts, strict=True):
            steps = np.diff(ages)
            squares += float(np.sum((np.diff(index) - drift * steps) ** 2 / steps))
            n_steps += len(steps) - 1
        diffusion = squares / n_steps if n_steps else 0.0
        floor = 1e-12 * float(np.max(np.abs(drifts))) ** 2 * float(times.max())
        diffusion = max(diffusion, floor, 1e-300)
        # Over units, a drift has the variance v + diffusion / time; v and the mean by moments.
        noise = diffusion / times
        mean = float(np.mean(drifts))
        spread = float(np.var(drifts, ddof=1)) if len(drifts) > 1 else 0.0
        variance = max(spread - float(np.mean(noise)), 1e-4 * mean**2, 1e-300)
        drift = float(np.average(drifts, weights=1 / (variance + noise)))
        if drift <= 0:
            raise ValueError(
                f"the health index does not increase with damage: its mean drift is {drift:.3g} "
                f"per unit of time over {len(drifts)} units. Turn its sign if low values are "
                f"damage, set another onset, or use model='weibull'."
            )
        return cls(threshold, drift, variance, diffusion)

    def posterior(self, elapsed: Array, climbed: Array) -> tuple[Array, Array]:
        """Return mean and variance of the drift of a unit after what it has climbed."""
        precision = 1 / self.drift_variance + elapsed / self.diffusion
        mean = (self.drift / self.drift_variance + climbed / self.diffusion) / precision
        return mean, 1 / precision

    def cdf(self, remaining: Array, states: Array) -> Array:
        """Return the probability to reach the threshold, given that it is reached at all.

        Parameters
        ----------
        remaining : ndarray
            Remaining lives.
        states : ndarray of shape (..., 3)
            Present index, time since the onset and increase of the index since then.
        """
        mean, variance = self.posterior(states[..., 1], states[..., 2])
        # A unit at or above the threshold that still runs is about to fail.
        distance = np.maximum(self.threshold - states[..., 0], 1e-6 * abs(self.threshold) + 1e-12)
        r, d, m, v, q = remaining, distance, mean, variance, self.diffusion
        a = 2 * d / q
        # Probability to reach the threshold ever, which divides: damage does not heal.
        ever = ndtr(m / np.sqrt(v)) + _reflected(-m / np.sqrt(v), (m + a * v) / np.sqrt(v))
        width = np.sqrt(np.maximum(r * q + r**2 * v, 1e-300))
        passed = (m * r - d) / width
        found = ndtr(passed) + _reflected(passed, (d + m * r + a * v * r) / width)
        return np.clip(np.where(r > 0, found, 0.0) / ever, 0, 1)


def _reflected(direct: Array, mirrored: Array) -> Array:
    """Return exp(2 m d / q + 2 v d**2 / q**2) Phi(-mirrored), without overflow.

    The exponent equals (mirrored**2 - direct**2) / 2, and Phi(-x) exp(x**2 / 2) is half the scaled
    complementary error function of x / sqrt(2).
    """
    return np.exp(-(direct**2) / 2) * erfcx(np.maximum(mirrored, -35.0) / np.sqrt(2)) / 2
