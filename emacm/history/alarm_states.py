"""Alarms as states: raised by several readings, cleared by quiet ones, told when they change.

The rule of an alarm follows from the false alarms that a user accepts.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import beta

from emacm._statements import Statement
from emacm.decisions.pipelines import final_estimator
from emacm.history.records import identity

Array = NDArray[np.floating]


class Rule(NamedTuple):
    """When an alarm is raised and cleared.

    Attributes
    ----------
    needed, of : int
        It is raised when `needed` of the last `of` readings are a reason for it.
    quiet : int
        It is cleared after so many successive readings that are none.
    """

    needed: int = 3
    of: int = 5
    quiet: int = 5


def reasons_of(
    record: Mapping[str, Any],
    defects: Iterable[Statement],
    *,
    healthy: Collection[str],
    typicality: float = 0.0,
) -> dict[tuple[str, str], str]:
    """Return what a record is a reason for an alarm for, in words.

    Parameters
    ----------
    record : mapping of str to object
        Fields of a record.
    defects : iterable of Statement
        Defects of channels, and what is far outside the training.
    healthy : collection of str
        Decisions that are no reason.
    typicality : float
        Typicality at or below which a reading is untypical, which is a reason.

    Returns
    -------
    dict of (channel, kind) to str
        Kinds are "error", "decision" (untypical readings included) and "input".

    Examples
    --------
    >>> record = {"decision": "worn", "typicality": 0.4, "error": ""}
    >>> dead = Statement("constant", "current", "current: constant")
    >>> reasons_of(record, [dead], healthy=["new"])
    {('', 'decision'): 'worn', ('current', 'input'): 'current: constant'}
    """
    found: dict[tuple[str, str], str] = {}
    if record["error"]:
        found["", "error"] = record["error"]
    rare = record["typicality"] is not None and record["typicality"] <= typicality
    if record["decision"] is not None and (record["decision"] not in healthy or rare):
        untypical = f", typicality {record['typicality']:.2g}" if rare else ""
        found["", "decision"] = record["decision"] + untypical
    for defect in defects:
        key = defect.channel, "input"
        found[key] = "; ".join(filter(None, [found.get(key), defect.text]))
    return found


class AlarmStates:
    """The alarms of one unit.

    Parameters
    ----------
    unit : str
        The unit.
    rule : Rule
        When they are raised and cleared.

    Examples
    --------
    >>> alarms = AlarmStates("pump 3", Rule(needed=2, of=3, quiet=2))
    >>> worn = {("", "decision"): "worn"}
    >>> for hour, reasons in enumerate([worn, {}, worn, worn, {}, {}, {}]):
    ...     for change in alarms.update(reasons, f"2026-03-01T0{hour}:00:00.000Z"):
    ...         print(change["time"][:16], change["state"], change["text"])
    2026-03-01T02:00 raised worn
    2026-03-01T05:00 cleared worn
    """

    def __init__(self, unit: str, rule: Rule) -> None:
        self._unit, self._rule = unit, rule
        # Whether the last readings were a reason, and the alarm, of each channel and kind.
        self._known: dict[tuple[str, str], tuple[list[bool], dict[str, Any] | None]] = {}

    def update(self, reasons: Mapping[tuple[str, str], str], time: str) -> list[dict[str, Any]]:
        """Continue with a reading; return the alarms that changed their state.

        Parameters
        ----------
        reasons : mapping of (channel, kind) to str
            As `reasons_of` returns them.
        time : str
            When it ended, in UTC.

        Returns
        -------
        list of dict
            As in the field "alarms" of a record.
        """
        rule, changes = self._rule, []
        for key in dict.fromkeys([*self._known, *reasons]):
            before, alarm = self._known.pop(key, ([], None))
            recent = [*before, key in reasons][-max(rule.of, rule.quiet) :]
            if alarm is None and sum(recent[-rule.of :]) >= rule.needed:
                alarm = self._raised(*key, reasons.get(key, ""), time)
                changes.append(dict(alarm))
            elif alarm is not None and not any(recent[-rule.quiet :]):
                changes.append(alarm | {"state": "cleared", "time": time})
                alarm = None
            if alarm is not None or any(recent):
                self._known[key] = recent, alarm
        return changes

    def _raised(self, channel: str, kind: str, text: str, time: str) -> dict[str, Any]:
        return {
            "id": identity([self._unit, channel, kind])[:12],
            "unit": self._unit,
            "channel": channel,
            "kind": kind,
            "severity": "alarm" if kind == "decision" else "warning",
            "state": "raised",
            "since": time,
            "time": time,
            "by": "",
            "text": text,
        }

    def state(self) -> list[Any]:
        """Return what `restore` needs, as values of JSON."""
        return [[*key, *known] for key, known in self._known.items()]

    def restore(self, state: Iterable[Any]) -> None:
        """Continue from a state."""
        self._known = {(channel, kind): (recent, alarm) for channel, kind, recent, alarm in state}


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
