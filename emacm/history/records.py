"""The record: what is stated of a recording, or of an interval of a stream, and its JSON Schema."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from emacm._version import __version__
from emacm.files.sample_times import stated_date

VERSION = "1.0"  # of the schema; fields are only added in versions 1.x

_TEXT, _NUMBER = {"type": "string"}, {"type": ["number", "null"]}
_TIME = {"type": ["string", "null"], "pattern": r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z$"}


def _about(kind: Mapping[str, Any], text: str) -> dict[str, Any]:
    return {**kind, "description": text}


def _table(fields: dict[str, Any], **others: Any) -> dict[str, Any]:
    """Return the schema of an object of which every field is required, and no other one allowed."""
    closed = {"required": list(fields), "additionalProperties": False}
    return {"type": "object", "properties": fields, **closed, **others}


ALARM = _table(
    {
        "id": _about(_TEXT, "identity of the alarm: the same for unit, channel and kind"),
        "unit": _about(_TEXT, "unit, or machine"),
        "channel": _about(_TEXT, "channel; empty if it is the whole unit"),
        "kind": _about(_TEXT, "such as decision, untypical, input, or the name of a chart"),
        "severity": {"enum": ["warning", "alarm"], "description": "how serious it is"},
        "state": _about(
            {"enum": ["raised", "acknowledged", "suppressed", "cleared"]}, "its state from now on"
        ),
        "since": _about(_TIME, "when it was raised, in UTC"),
        "time": _about(_TIME, "when its state changed, in UTC"),
        "by": _about(_TEXT, "who acknowledged or suppressed it; empty if nobody did"),
        "text": _about(_TEXT, "what was noticed"),
    }
)
_FIELDS = {
    "recording": _about(_TEXT, "path of the file, or name of the stream"),
    "unit": _about(_TEXT, "unit, or machine; empty if it is not known"),
    "start": _about(_TIME, "start, in UTC; null if it is not known"),
    "end": _about(_TIME, "end, in UTC; null if it is not known"),
    "times": {
        "enum": ["file", "stated", "modified", "clock", ""],
        "description": "where the times are from: dates in the file; stated; the time at which "
        "the file was written (the end); the clock of the computer (the end)",
    },
    "stream_start": _about(_NUMBER, "start in the time of a stream [s]; null for a file"),
    "stream_end": _about(_NUMBER, "end in the time of a stream [s]; null for a file"),
    "decision": _about({"type": ["string", "null"]}, "null if there is none"),
    "expected_cost": _about(_NUMBER, "expected cost of the decision"),
    "typicality": _about(_NUMBER, "share of the training that is as far from all classes"),
    "warnings": _about(_TEXT, "defects of the recording, separated by '; '"),
    "outside_training": _about(_TEXT, "what is outside the range of the training"),
    "error": _about(_TEXT, "why there is no decision; empty if there is one"),
    "alarms": {"type": "array", "items": ALARM, "description": "alarms that changed their state"},
    "complete": _about({"type": "boolean"}, "false for an interval that is not finished"),
    "model": _about(_TEXT, "digest of the model"),
    "model_note": _about(_TEXT, "note that is stored in the file of the model"),
    "emacm": _about(_TEXT, "version of emacm"),
    "schema": _about(_TEXT, "version of this schema"),
    "id": _about(_TEXT, "identity: the same if the same is computed again"),
}
SCHEMA = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": "Record of emacm",
    "description": "What a model states of a recording, or of an interval of a stream.",
    **_table(_FIELDS),
    "patternProperties": {
        r"^P\(.*\)$": _about(
            _NUMBER,
            "probability of a class, given that one of them is true; P(unknown): that none is",
        )
    },
}
"""JSON Schema of a record; that of an alarm is `ALARM`."""


def record_of(found: Mapping[str, Any] | Any, **others: Any) -> dict[str, Any]:
    """Return a record, whose values are those of JSON.

    Parameters
    ----------
    found : mapping of str to object, or Reading
        Some of the fields, as a row of `score`, or a reading of `OrderMonitor`. Missing ones are
        empty.
    **others : object
        Further fields, such as `unit`, `recording`, `start` and `end`; the last two are dates, also
        of pandas, in UTC if they have no zone.

    Returns
    -------
    dict
        The fields of the JSON Schema that ``emacm schema`` prints.

    See Also
    --------
    History : Records in a file of SQLite.

    Examples
    --------
    >>> row = {"decision": "worn", "expected_cost": 0.5, "P(worn)": 0.75}
    >>> record = record_of(row, unit="pump 3", end=pd.Timestamp("2026-03-01 12:00"))
    >>> record["decision"], record["P(worn)"], record["end"], record["start"]
    ('worn', 0.75, '2026-03-01T12:00:00.000Z', None)
    """
    given = {**(found if isinstance(found, Mapping) else _of_reading(found)), **others}
    given["start"], given["end"] = (utc(given.get(name)) for name in ("start", "end"))
    texts = (name for name, kind in _FIELDS.items() if "null" not in kind.get("type", ""))
    empty: dict[str, Any] = dict.fromkeys(texts, "")
    empty |= {"alarms": [], "complete": True, "emacm": __version__, "schema": VERSION}
    record = {}
    for name in [*_FIELDS, *(name for name in given if name.startswith("P("))]:
        value = _plain(given.get(name))
        record[name] = empty.get(name) if value is None else value
    if record["decision"] is not None:
        record["decision"] = str(record["decision"])
    where = ("unit", "recording", "start", "end", "stream_start", "stream_end", "model")
    record["id"] = record["id"] or identity(record[name] for name in where)
    return record


def times_of(recording: Any, key: str | None = None) -> dict[str, Any]:
    """Return start and end of the recording of a file, and from where they are known.

    Parameters
    ----------
    recording : FileRecording
        The recording.
    key : str, optional
        Key of meta with the start; a number, such as a cycle, is no date.

    Returns
    -------
    dict
        The fields `start`, `end` and `times` of a record.

    Raises
    ------
    ValueError
        If the meta has no such key, or its value is no time.
    """
    start, times = None, "stated"
    if key is not None:
        if key not in recording.meta:
            raise ValueError(f"its meta has no {key!r} (--time), only {[*recording.meta]}.")
        if not isinstance(stated := recording.meta[key], int | float):
            start = stated_date(stated, key)
    if start is None:
        start, times = recording.start, "file"
    length = pd.Timedelta(seconds=recording.duration)
    if start is None:
        written = pd.Timestamp(Path(recording.path).stat().st_mtime, unit="s")
        start, times = written - length, "modified"
    return {"start": start, "end": start + length, "times": times}


def _of_reading(reading: Any) -> dict[str, Any]:
    names = ("decision", "expected_cost", "typicality", "complete", "error")
    found = {name: getattr(reading, name) for name in names}
    found |= {f"P({label})": value for label, value in reading.posterior.items()}
    if reading.unknown_proba is not None:
        found["P(unknown)"] = reading.unknown_proba
    outside = reading.outside_training
    found["outside_training"] = "; ".join(statement.text for statement in outside)
    others = (defect.text for defect in reading.defects if defect not in outside)
    found["warnings"] = "; ".join(others)
    return found | {"stream_start": reading.start, "stream_end": reading.time}


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value


def utc(time: Any) -> str | None:
    """Return a time as a text in UTC; None if it is none. One without a zone is in UTC.

    Parameters
    ----------
    time : Timestamp, datetime, str or None
        The time.

    Examples
    --------
    >>> utc("2026-03-01T13:00:00+01:00")
    '2026-03-01T12:00:00.000Z'
    """
    if time is None or pd.isna(time):
        return None
    stamp = pd.Timestamp(time)
    stamp = stamp if stamp.tz is None else stamp.tz_convert(None)
    return f"{stamp.isoformat(timespec='milliseconds')}Z"


def identity(parts: Iterable[Any]) -> str:
    """Return an identity that follows from these values: 32 hexadecimal digits."""
    text = "\0".join(map(str, parts))
    return sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:32]
