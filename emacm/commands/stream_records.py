"""The records of a stream: of each reading, with the states of alarms, written to all sinks."""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import pandas as pd

from emacm.history.alarm_states import AlarmSetting, AlarmStates, alarm_setting, reasons_of
from emacm.history.records import identity, record_of
from emacm.history.sinks import sinks_of
from emacm.history.sqlite_history import History
from emacm.models.model_files import model_description
from emacm.recordings.digests import model_digest
from emacm.recordings.names import printable
from emacm.reports.facts import healthy_label
from emacm.streams.streamed_models import Reading

Record = dict[str, Any]


class StreamRecords:
    """Makes a record of each reading, and writes it to the standard output and the sinks.

    Parameters
    ----------
    model : estimator
        The model.
    has_dates : bool
        Whether the times of the stream are dates, in seconds since 1970.
    options : Namespace
        Options of ``emacm monitor``.
    """

    def __init__(self, model: Any, has_dates: bool, options: argparse.Namespace) -> None:
        self._options, self._has_dates = options, has_dates
        source = options.source
        unit = printable(options.name or ("" if source == "-" else Path(source).stem))
        self._same = {"unit": unit, "recording": printable(Path(source))}
        self._same["model_note"] = model_description(options.model)["note"] or ""
        self._same["model"] = model_digest(model)
        stated = options.healthy or getattr(model, "healthy_", None)
        labels = model.classes_.tolist()
        self._healthy = healthy_label(labels, stated, "--healthy", required=False)
        self._setting = self._alarm_setting(model)
        self._alarms = AlarmStates(unit, self._setting.rule)
        self._turns_since: float | None = None  # time of the stream [s]
        self._sinks = sinks_of(options.sink)
        self._page_written = -math.inf  # time of the computer [s]
        self._history = next((sink for sink in self._sinks if isinstance(sink, History)), None)
        if options.page and self._history is None:
            raise ValueError("--page needs a history: give --sink FILE.sqlite as well.")

    def _alarm_setting(self, model: Any) -> AlarmSetting:
        """Return the setting for the accepted false alarms, and state it."""
        options = self._options
        length = options.every or math.inf
        if options.unit == "revolutions":
            length *= 2 * math.pi / options.max_speed  # the shortest time that they take [s]
        hours = length / 3600
        needed, of = options.alarm_after or (None, 5)
        accepted = options.false_alarms * hours / 1000
        if options.every is None:  # a single reading, whose decision counts
            needed, accepted = needed or 1, 0.0
        rule = {"needed": needed, "of": of, "quiet": options.clear_after}
        chosen = alarm_setting(model, self._healthy, accepted, **rule)
        text = _setting_text(chosen, self._healthy, hours, options.false_alarms)
        print(f"Alarms: {text}.", file=sys.stderr)
        return chosen

    def of_reading(self, reading: Reading, ahead: float, content: bytes) -> Record:
        """Return the record of a reading.

        Parameters
        ----------
        reading : Reading
            The reading.
        ahead : float
            What is to be added to its times, for those of the stream [s].
        content : bytes
            What was read last: another stream of the same times has other identities.
        """
        record = self.record(reading, reading.start + ahead, reading.time + ahead, content)
        if reading.complete and not self._is_silent(reading):
            known = [record["decision"]] if self._healthy is None else [str(self._healthy)]
            limit = self._setting.typicality
            reasons = reasons_of(record, reading.defects, healthy=known, typicality=limit)
            record["alarms"] = self._alarms.update(reasons, record["end"])
        return record

    def record(self, found: Any, start: float, end: float, content: bytes) -> Record:
        """Return the record of what is known between two times of the stream, without alarms."""
        options, now = self._options, pd.Timestamp.now("UTC")
        if self._has_dates or options.start:
            origin = pd.Timestamp(0 if self._has_dates else options.start)
            times = "file" if self._has_dates else "stated"
            began, ended = (origin + pd.Timedelta(seconds=time) for time in (start, end))
        else:
            times, began, ended = "clock", now - pd.Timedelta(seconds=end - start), now
        facts = self._same | {"start": began, "end": ended, "times": times}
        facts |= {"stream_start": start, "stream_end": end}
        record = record_of(found, **facts)
        parts = [*self._same.values(), start, end, sha256(content).hexdigest(), record["error"]]
        return record | {"id": identity(parts)}

    def _is_silent(self, reading: Reading) -> bool:
        """Tell whether the shaft turns too slowly, or has not turned for long enough."""
        least = self._options.min_speed
        if least > 0 and not reading.fastest >= least:  # also if it is not known
            self._turns_since = None
            return True
        if self._turns_since is None or reading.start < self._turns_since:  # the clock set back
            self._turns_since = reading.start
        return reading.start - self._turns_since < self._options.quiet

    def write(self, records: Sequence[Record]) -> None:
        """Write records to the standard output and to all sinks."""
        for record in records:
            print(json.dumps(record), flush=True)
            for sink in self._sinks:
                sink.write(record)
        self._write_page()

    def _write_page(self, every: float = 10.0) -> None:
        """Write the page of the fleet, at most once in some seconds."""
        now, history = time.monotonic(), self._history
        if self._options.page and history and now >= self._page_written + every:
            from emacm.reports.fleet import write_fleet  # needs jinja2

            self._page_written = now
            healthy = None if self._healthy is None else str(self._healthy)
            found = history.last_records(30), history.alarms(open_only=True)
            write_fleet(self._options.page, *found, healthy=healthy, only=self._same["unit"])

    def close(self) -> None:
        """Write the page of the fleet, and close the sinks."""
        self._write_page(every=0.0)
        for sink in reversed(self._sinks):  # the history last
            sink.close()

    def state(self, pending: Sequence[Record] = ()) -> dict[str, Any]:
        """Return what `restore` needs, with records that are not written yet."""
        alarms, since = self._alarms.state(), self._turns_since
        return {"alarms": alarms, "turns_since": since, "pending": pending}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a state, and write what was pending.

        If the process was killed between writing the state and the records, they are written now;
        if it was killed later, they are written again, with the same identities.
        """
        self._alarms.restore(state["alarms"])
        self._turns_since = state["turns_since"]
        self.write(state["pending"])


def _setting_text(chosen: AlarmSetting, healthy: Any, hours: float, accepted: float) -> str:
    """State a setting in words."""
    if healthy is None:
        return "none on decisions, as the healthy state is not known; give --healthy LABEL"
    rule, least = chosen.rule, chosen.typicality
    untypical = f", or have a typicality of at most {least:.2g}," if least else ""
    text = (
        f"raised by {rule.needed} of {rule.of} readings that are not {healthy}{untypical} and "
        f"cleared by {rule.quiet} others; "
    )
    if not math.isfinite(hours):
        return text + "false alarms are not known without --every"
    if chosen.rate is None:
        return text + "false alarms of this model are not known: --alarm-after sets the rule"
    expected, low, high = (f"{float(f'{x / hours * 1000:.2g}'):,.10g}" for x in chosen.rate)
    text += f"expect {expected} false alarms in 1000 h ({low} to {high})"
    if chosen.rate.expected > accepted * hours / 1000:
        text += f"; for {accepted:g} in 1000 h train with more healthy units or lengthen --every"
    return text
