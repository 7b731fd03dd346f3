"""Alarms as states: raised by several readings, cleared by quiet ones, told when they change."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any, NamedTuple

from emacm._statements import Statement
from emacm.history.records import identity

Reasons = dict[tuple[str, str], str]  # by channel and kind


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
) -> Reasons:
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
    found: Reasons = {}
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
