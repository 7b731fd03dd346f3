"""The history: a file of SQLite with all records, and the states of the alarms."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.history.records import ALARM

Array = NDArray[np.float64]
_COLUMNS = (
    "id", "unit", "recording", "start", "end", "decision", "expected_cost", "typicality",
    "warnings", "outside_training", "complete", "error", "model",
)  # fmt: skip
_ALARM_COLUMNS = tuple(ALARM["properties"])
_QUOTED = ", ".join(f'"{name}"' for name in _COLUMNS)  # END is a word of SQL
_TABLES = (
    f"records ({_QUOTED}, record TEXT, PRIMARY KEY (id))",
    f"alarms ({', '.join(_ALARM_COLUMNS)}, PRIMARY KEY (id, since))",
    "unsent (sink TEXT, id TEXT, PRIMARY KEY (sink, id))",
    'features (id TEXT PRIMARY KEY, made_by TEXT, "values" BLOB)',
)
_INDICES = ('records_of_unit ON records (unit, "end")', "records_of_name ON records (recording)")
_IS_CHANGED = (  # who acknowledged it is kept; what is written again does not open it again
    "ON CONFLICT (id, since) DO UPDATE SET state = excluded.state, time = excluded.time, "
    "text = excluded.text WHERE excluded.time >= alarms.time"
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
        try:
            self._base = sqlite3.connect(self.path, timeout=30)
            self._base.row_factory = sqlite3.Row
            self._base.execute("PRAGMA journal_mode = WAL")  # others read while it is written
            with self._base:
                for table in _TABLES:
                    self._base.execute(f"CREATE TABLE IF NOT EXISTS {table}")
                for index in _INDICES:
                    self._base.execute(f"CREATE INDEX IF NOT EXISTS {index}")
        except sqlite3.Error as error:
            raise ValueError(
                f"{self.path} cannot be used as a history: {error}. Name a new file, or one that "
                f"emacm wrote."
            ) from error

    def close(self) -> None:
        """Close the file."""
        self._base.close()

    def write(self, *records: Mapping[str, Any]) -> None:
        """Write records and the alarms that changed with them; all or, after an error, none."""
        try:
            with self._base:
                for record in records:
                    values = [*(record[name] for name in _COLUMNS), json.dumps(record)]
                    self._insert("OR REPLACE INTO records", values)
                    for change in record["alarms"]:
                        alarm = [change[name] for name in _ALARM_COLUMNS]
                        self._insert("INTO alarms", alarm, _IS_CHANGED)
        except sqlite3.Error as error:
            raise OSError(f"{self.path} cannot be written: {error}.") from error

    def _insert(self, where: str, values: Sequence[Any], otherwise: str = "") -> None:
        places = ", ".join("?" * len(values))
        self._base.execute(f"INSERT {where} VALUES ({places}) {otherwise}", values)

    def records(self, unit: str | None = None) -> list[dict[str, Any]]:
        """Return all records, or those of a unit, in order of their end."""
        where, values = ("", ()) if unit is None else ("WHERE unit = ?", (unit,))
        found = self._base.execute(f'SELECT record FROM records {where} ORDER BY "end", id', values)
        return [json.loads(text) for (text,) in found]

    def last_records(self, most: int = 1) -> list[dict[str, Any]]:
        """Return the last records of each unit, at most so many, in order of their end."""
        query = 'SELECT record FROM records WHERE unit = ? ORDER BY "end" DESC, id DESC LIMIT ?'
        units = self._base.execute("SELECT DISTINCT unit FROM records ORDER BY unit").fetchall()
        found = [self._base.execute(query, (*unit, most)).fetchall()[::-1] for unit in units]
        return [json.loads(text) for records in found for (text,) in records]

    def known(self) -> list[dict[str, Any]]:
        """Return recording, identity, decision and error of each record."""
        found = self._base.execute("SELECT recording, id, decision, error FROM records")
        return [dict(row) for row in found]

    def alarms(self, *, open_only: bool = False) -> list[dict[str, Any]]:
        """Return the alarms, the latest first; those that are not cleared, if `open_only`."""
        where = "WHERE state != 'cleared'" if open_only else ""
        found = self._base.execute(f"SELECT * FROM alarms {where} ORDER BY since DESC, id")
        return [dict(row) for row in found]

    def write_features(self, identity: str, made_by: str, values: Array) -> None:
        """Write the features of a record; `made_by` is the digest of the steps that made them."""
        with self._base:
            content = np.asarray(values, "<f8").tobytes()
            self._insert("OR REPLACE INTO features", [identity, made_by, content])

    def features(self, made_by: str) -> tuple[list[str], Array]:
        """Return recordings and the features of shape (n_recordings, n_features) of these steps."""
        found = self._base.execute(
            'SELECT recording, "values" FROM features JOIN records USING (id) WHERE made_by = ? '
            'ORDER BY "end", id',
            (made_by,),
        ).fetchall()
        rows = [np.frombuffer(row["values"], "<f8") for row in found]
        return [row["recording"] for row in found], np.array(rows)

    def set_state(self, identity: str, state: str, *, by: str, time: str) -> int:
        """Set the state of an alarm that is not cleared; return how many there are."""
        with self._base:
            return self._base.execute(
                "UPDATE alarms SET state = ?, by = ?, time = ? WHERE id = ? AND state != 'cleared'",
                (state, by, time, identity),
            ).rowcount

    def note_unsent(self, sink: str, identity: str) -> None:
        """Note that a record is still to be sent."""
        with self._base:
            self._insert("OR REPLACE INTO unsent", [sink, identity])

    def note_sent(self, sink: str, identity: str) -> None:
        """Note that a record was sent."""
        with self._base:
            self._base.execute("DELETE FROM unsent WHERE sink = ? AND id = ?", (sink, identity))

    def unsent(self, sink: str, most: int = -1) -> list[dict[str, Any]]:
        """Return the records still to be sent, in order of their end; the first `most` of them."""
        found = self._base.execute(
            "SELECT record FROM records JOIN unsent USING (id) WHERE sink = ? "
            'ORDER BY "end", id LIMIT ?',
            (sink, most),
        )
        return [json.loads(text) for (text,) in found]
