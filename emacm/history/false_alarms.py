"""The rule of an alarm that follows from the false alarms that a user accepts."""

from __future__ import annotations

from bisect import bisect_right
from typing import Any, NamedTuple

import numpy as np

from emacm.alarms.repeated_readings import FalseAlarmRate, false_alarm_rate
from emacm.decisions.pipelines import final_estimator
from emacm.history.alarm_states import Rule


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
    n_groups : int
        Healthy groups of the training from which the rate is known.
    """

    rule: Rule
    typicality: float = 0.0
    rate: FalseAlarmRate | None = None
    n_groups: int = 0


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
    return AlarmSetting(Rule(needed, of, quiet), float(steps[chosen]), found, n_groups)
