"""The history: a file of SQLite with all records, and the states of the alarms."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm._checks import located
from emacm.history.records import ALARM
from emacm.recordings.names import printable

Array = NDArray[np.float64]
_COLUMNS = (
    "id", "unit", "recording", "start", "end", "decision", "expected_cost", "typicality",
    "warnings", "outside_training", "complete", "error", "model",
)  # fmt: skip
_ALARM_COLUMNS = tuple(ALARM["properties"])
_TABLES = {  # columns and primary key
    "records": ((*_COLUMNS, "record"), "id"),
    "alarms": (_ALARM_COLUMNS, "id, since"),
    "unsent": (("sink", "id"), "sink, id"),
    "features": (("id", "made_by", "values"), "id"),
}
_VERSION = 1  # of these tables; 0 if it is not stated, as by the first versions of emacm
# The clock of a stream is not that of the computer, which dates what a person does: times are not
# compared. Cleared is the last state; who acknowledged an alarm is kept. A record that was written
# before opens nothing again. A new one does, even if the clock shows a time for the second time.
_IS_CHANGED = (
    "ON CONFLICT (id, since) DO UPDATE SET state = excluded.state, time = excluded.time, "
    "text = excluded.text, by = CASE excluded.state WHEN 'raised' THEN '' ELSE alarms.by END "
    "WHERE excluded.state = 'cleared' OR alarms.state = 'raised'"
)


def is_history(path: Path | None) -> bool:
    """Tell whether the name of a file is that of a history."""
    return path is not None and path.suffix in (".sqlite", ".db")


class History:
    """Records and alarms in a file of SQLite, which other programs can read.

    Table `records` has a row for each record: the fields that a query needs, and in `record` all of
    them as JSON. Table `alarms` has the present state of each alarm since it was raised. What was
    written is on the disk when the method returns; writing a record again changes nothing.

    Parameters
    ----------
    path : str or Path
        The file; it is created if there is none.

    Raises
    ------
    ValueError
        If the file is no such history, or cannot be opened.

    See Also
    --------
    emacm.monitoring.record_of : Records that it stores.

    Examples
    --------
    >>> import tempfile
    >>> from emacm.history.records import record_of
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     history = History(folder + "/pump.sqlite")
    ...     history.write(record_of({"decision": "worn"}, unit="pump 3", recording="1.csv"))
    ...     [(record["unit"], record["decision"]) for record in history.records()]
    ...     history.close()
    [('pump 3', 'worn')]
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._sinks: list[str] = []  # to which each record is to be sent
        try:
            self._base = sqlite3.connect(self.path, timeout=30, isolation_level=None)
            ((version,),) = self._base.execute("PRAGMA user_version")
            if version > _VERSION:
                raise ValueError(f"its tables have version {version}, emacm knows {_VERSION}")
            for name, (columns, _) in _TABLES.items():
                found = [
                    column for _, column, *_ in self._base.execute(f"PRAGMA table_info({name})")
                ]
                if found and found != [*columns]:
                    raise ValueError(f"its table {name} has the columns {found}")
            self._base.execute("PRAGMA journal_mode = WAL")  # others read while it is written
            for name, (columns, key) in _TABLES.items():
                quoted = ", ".join(f'"{column}"' for column in columns)  # END is a word of SQL
                table = f"{name} ({quoted}, PRIMARY KEY ({key}))"
                self._base.execute(f"CREATE TABLE IF NOT EXISTS {table}")
            index = 'CREATE INDEX IF NOT EXISTS records_of_unit ON records (unit, "end")'
            self._base.execute(index)
            if version < _VERSION:
                self._base.execute(f"PRAGMA user_version = {_VERSION}")
        except (sqlite3.Error, ValueError) as error:
            raise ValueError(
                f"{self.path} cannot be used as a history: {error}. Name a new file."
            ) from error

    def close(self) -> None:
        """Close the file."""
        self._base.close()

    def send_to(self, sink: str) -> None:
        """Note each record, while it is written, as one that is still to be sent to a sink."""
        self._sinks.append(sink)

    def write(self, *records: Mapping[str, Any]) -> None:
        """Write records and the alarms that changed with them; all or, after an error, none."""
        with self._base:  # which undoes what was begun
            self._sql("BEGIN IMMEDIATE")
            for record in records:
                is_new = not self._sql("SELECT id FROM records WHERE id = ?", record["id"])
                values = [*(record[name] for name in _COLUMNS), json.dumps(record)]
                self._insert("OR REPLACE INTO records", values)
                for sink in self._sinks:
                    self.note_unsent(sink, record["id"])
                for change in record["alarms"]:
                    alarm = [change[name] for name in _ALARM_COLUMNS]
                    opened = f" OR (alarms.state = 'cleared' AND {is_new})"
                    self._insert("INTO alarms", alarm, _IS_CHANGED + opened)
            self._sql("COMMIT")

    def _insert(self, where: str, values: Sequence[Any], otherwise: str = "") -> None:
        places = ", ".join("?" * len(values))
        self._sql(f"INSERT {where} VALUES ({places}) {otherwise}", *values)

    def _sql(self, statement: str, *values: Any) -> list[tuple[Any, ...]]:
        """Return the rows that a statement finds."""
        valid = [printable(value) if isinstance(value, str) else value for value in values]
        try:
            return self._base.execute(statement, valid).fetchall()
        except sqlite3.Error as error:
            raise OSError(
                f"{self.path} cannot be read or written: {error}. If it is damaged, sqlite3 FILE "
                f".recover finds what is left of it."
            ) from error

    def _records(self, where: str, *values: Any) -> list[dict[str, Any]]:
        """Return the records of the rows that `where` chooses."""
        records = []
        for identity, text in self._sql(f"SELECT id, record FROM records {where}", *values):
            with located(f"{self.path}: its record {identity} is damaged, delete it"):
                records.append(json.loads(text))
                if not {*_COLUMNS, "alarms"} <= set(records[-1]):
                    raise ValueError("fields are missing.")
        return records

    def records(self, unit: str | None = None) -> list[dict[str, Any]]:
        """Return all records, or those of a unit, in order of their end."""
        where, values = ("", ()) if unit is None else ("WHERE unit = ?", (unit,))
        return self._records(f'{where} ORDER BY "end", id', *values)

    def last_records(self, most: int = 1) -> list[dict[str, Any]]:
        """Return the last records of each unit, at most so many, in order of their end."""
        where = 'WHERE unit = ? ORDER BY "end" DESC, id DESC LIMIT ?'
        units = self._sql("SELECT DISTINCT unit FROM records ORDER BY unit")
        return [record for (u,) in units for record in self._records(where, u, most)[::-1]]

    def known(self, made_by: str | None = None) -> list[dict[str, Any]]:
        """Return recording, identity, decision and error of each record.

        With `made_by`, as for `write_features`, of those whose features are stored.
        """
        names = "recording", "id", "decision", "error"
        stored = "?1 IS NULL OR id IN (SELECT id FROM features WHERE made_by = ?1)"
        found = self._sql(f"SELECT {', '.join(names)} FROM records WHERE {stored}", made_by)
        return [dict(zip(names, row, strict=True)) for row in found]

    def alarms(self, *, open_only: bool = False) -> list[dict[str, Any]]:
        """Return the alarms, the latest first; those that are not cleared, if `open_only`."""
        where = "WHERE state != 'cleared'" if open_only else ""
        found = self._sql(f"SELECT * FROM alarms {where} ORDER BY since DESC, id")
        return [dict(zip(_ALARM_COLUMNS, row, strict=True)) for row in found]

    def write_features(self, identity: str, made_by: str, values: Array) -> None:
        """Write the features of a record; `made_by` is the digest of the steps that made them."""
        content = np.asarray(values, "<f8").tobytes()
        self._insert("OR REPLACE INTO features", [identity, made_by, content])

    def features(self, made_by: str, n_features: int) -> tuple[list[str], Array]:
        """Return recordings and the features of shape (n_recordings, n_features) of these steps.

        Of a recording that was decided on several times, those that were written last.
        """
        rows = dict(
            self._sql(
                'SELECT recording, "values" FROM features JOIN records USING (id) '
                'WHERE made_by = ? ORDER BY "end", features.rowid',
                made_by,
            )
        )
        with located(f"{self.path}: features are damaged (emacm score --features --again)"):
            found = [np.frombuffer(content, "<f8") for content in rows.values()]
            values = np.array(found).reshape(len(rows), n_features)
            if not np.isfinite(values).all():
                raise ValueError("they are not finite.")
        return [*rows], values

    def set_state(self, identity: str, state: str, *, by: str, time: str) -> int:
        """Set the state of an alarm that is not cleared; return how many there are."""
        which = "WHERE id = ? AND state != 'cleared'"
        values = state, by, time, identity
        self._sql(f"UPDATE alarms SET state = ?, by = ?, time = ? {which}", *values)
        return int(self._sql("SELECT changes()")[0][0])

    def note_unsent(self, sink: str, identity: str) -> None:
        """Note that a record is still to be sent."""
        self._insert("OR REPLACE INTO unsent", [sink, identity])

    def note_sent(self, sink: str, identity: str) -> None:
        """Note that a record was sent."""
        self._sql("DELETE FROM unsent WHERE sink = ? AND id = ?", sink, identity)

    def unsent(self, sink: str, most: int = -1) -> list[dict[str, Any]]:
        """Return the records still to be sent, in order of their end; the first `most` of them."""
        where = 'JOIN unsent USING (id) WHERE sink = ? ORDER BY "end", id LIMIT ?'
        return self._records(where, sink, most)
