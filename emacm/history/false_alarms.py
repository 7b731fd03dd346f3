"""The rule of an alarm that follows from the false alarms that a user accepts."""

from __future__ import annotations

from bisect import bisect_right
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import beta

from emacm.decisions.pipelines import final_estimator
from emacm.history.alarm_states import Rule

Array = NDArray[np.floating]


def repeated_run_length(probability: ArrayLike, needed: int, of: int) -> Array:
    """Return the mean number of readings until `needed` of the last `of` have a property.

    Parameters
    ----------
    probability : array-like of shape (n,)
        Probability of the property, for each reading independently.
    needed, of : int
        1 <= `needed` <= `of` <= 10.

    Returns
    -------
    ndarray of shape (n,)
        From the linear equations of the mean times to absorption of the Markov chain of the last
        ``of - 1`` readings: J. G. Kemeny and J. L. Snell, Finite Markov Chains (1960), section 3.5.

    Examples
    --------
    >>> repeated_run_length([0.01], 1, 1).round(6)
    array([100.])
    >>> p = 0.1  # a run of two, Feller, vol. 1, section XIII.7: (1 - p**2) / ((1 - p) * p**2)
    >>> repeated_run_length([p], 2, 2).round(6)
    array([110.])
    """
    p = np.atleast_1d(probability).astype(np.float64)
    states = [state for state in range(2 ** (of - 1)) if state.bit_count() < needed]
    place = {state: k for k, state in enumerate(states)}
    equations = np.tile(np.eye(len(states)), (len(p), 1, 1))
    for k, state in enumerate(states):
        for bit, chance in ((0, 1 - p), (1, p)):
            following = 2 * state + bit
            if following.bit_count() < needed:
                equations[:, k, place[following % 2 ** (of - 1)]] -= chance
    return np.linalg.solve(equations, np.ones((len(p), len(states), 1)))[:, 0, 0]


class FalseAlarmRate(NamedTuple):
    """False alarms per reading.

    Attributes
    ----------
    expected : float
        Mean over what the true probability of the property may be.
    low, high : float
        For the probabilities between which the true one is with a probability of 90 %.
    """

    expected: float
    low: float
    high: float


def false_alarm_rate(count: float, total: float, needed: int, of: int) -> FalseAlarmRate:
    """Return the rate of false alarms if a property was seen in some of the healthy recordings.

    Parameters
    ----------
    count, total : float
        Number of independent healthy recordings (or groups, with the sum of their shares) that have
        the property, and of all, none of which the model was fitted to.
    needed, of : int
        The alarm is raised by `needed` of the last `of` readings.

    Returns
    -------
    FalseAlarmRate
        For the probability, the posterior of Jeffreys' prior, Beta(count + 1/2, total - count +
        1/2): L. D. Brown, T. T. Cai and A. DasGupta, Statistical Science 16 (2001).

    Examples
    --------
    >>> few, many = (false_alarm_rate(0.02 * n, n, 3, 5).expected for n in (50, 5000))
    >>> f"{few:.1e} {many:.1e}"  # few recordings leave the rate uncertain
    '4.1e-04 4.6e-05'
    """
    nodes = np.concatenate([(np.arange(400) + 0.5) / 400, [0.05, 0.95]])  # quantiles
    rates = 1 / repeated_run_length(beta.ppf(nodes, count + 0.5, total - count + 0.5), needed, of)
    rates = np.maximum(rates, 0.0)  # rounding errors of rare alarms
    return FalseAlarmRate(float(rates[:-2].mean()), float(rates[-2]), float(rates[-1]))


class AlarmSetting(NamedTuple):
    """When a reading is a reason for an alarm on decisions, and how many raise it.

    Attributes
    ----------
    rule : Rule
        How many readings raise and clear an alarm.
    typicality : float
        Typicality at or below which a reading is a reason, whatever the decision is.
    rate : FalseAlarmRate or None
        False alarms per reading; None if they are not known.
    """

    rule: Rule
    typicality: float = 0.0
    rate: FalseAlarmRate | None = None


def alarm_setting(
    model: Any,
    healthy: Any,
    accepted: float,
    *,
    needed: int | None = None,
    of: int = 5,
    quiet: int = 5,
) -> AlarmSetting:
    """Return the setting whose expected false alarms are at most those that are accepted.

    The healthy recordings of the training, each judged without its group, show how often a healthy
    reading is decided otherwise, or is so untypical. Of the rules, the one that needs the fewest
    readings is taken, and then the largest typicality. It is assumed that successive readings of a
    healthy machine are independent. If they are not, there are more alarms of two or more readings:
    up to 5 times as many at a correlation of 0.5 (``benchmarks/fleet.py``).

    Parameters
    ----------
    model : estimator
        Fitted classifier, or a pipeline that ends with one.
    healthy : label
        Its healthy state.
    accepted : float
        False alarms per reading.
    needed : int, optional
        Number of readings that raise an alarm. Default: as few as possible.
    of : int
        Number of the last readings among which they are.
    quiet : int
        Number of successive readings that clear it.

    Returns
    -------
    AlarmSetting
        If no rule is good enough, the one with the fewest false alarms. If the model left no
        groups out, 3 of 5, and no rate.
    """
    try:
        left = final_estimator(model).left_out_decisions()
    except (AttributeError, ValueError):
        return AlarmSetting(Rule(needed or min(3, of), of, quiet))
    left = left[left["truth"] == healthy]
    n_groups = left["group"].nunique()

    def rate(needed: int, typicality: float) -> FalseAlarmRate:
        is_reason = (left["decision"] != healthy) | (left["typicality"] <= typicality)
        count = is_reason.groupby(left["group"]).mean().sum()
        return false_alarm_rate(count, n_groups, needed, of)

    if needed is None:
        enough = (k for k in range(1, of) if rate(k, 0.0).expected <= accepted)
        needed = next(enough, of)
    steps = np.concatenate([[0.0], np.unique(left["typicality"].dropna())])
    chosen = bisect_right(steps, accepted, lo=1, key=lambda step: rate(needed, step).expected) - 1
    found = rate(needed, steps[chosen])
    return AlarmSetting(Rule(needed, of, quiet), float(steps[chosen]), found)
