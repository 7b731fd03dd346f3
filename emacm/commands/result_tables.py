"""The tables of ``emacm score``, which hold a record for each file and are continued."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from emacm._saved import written_whole
from emacm.history.records import SCHEMA, record_of
from emacm.history.sqlite_history import History, is_history
from emacm.models.scoring import score_columns
from emacm.reports.inputs import as_cell, of_cell

Row = dict[str, Any]
_OF_STREAMS = ("alarms", "stream_start", "stream_end")


def columns_of(model: Any, *, of_streams: bool = False) -> list[str]:
    """Return the columns of a table: those of `score`, and the other fields of a record."""
    first = score_columns(model)
    left_out = () if of_streams else _OF_STREAMS
    return [*first, *(n for n in record_of({}) if n not in (*first, *left_out))]


def result_table(path: Path, model: Any) -> ResultTable | HistoryTable:
    """Return the table in a file.

    Parameters
    ----------
    path : Path
        A file that ends with .csv, .jsonl, .parquet, .sqlite or .db.
    model : estimator
        Fitted classifier.

    Raises
    ------
    ValueError
        If the name of the file has another suffix.
    """
    if is_history(path):
        return HistoryTable(path)
    if path.suffix not in (".csv", ".jsonl", ".parquet"):
        raise ValueError(f"{str(path)!r} must end with one of .csv, .jsonl, .parquet, .sqlite.")
    return ResultTable(path, columns_of(model, of_streams=path.suffix == ".jsonl"))


class HistoryTable:
    """A history as a table that is never read as a whole: only names, decisions and errors are."""

    def __init__(self, path: Path) -> None:
        self.path, self._history = path.resolve(), History(path)

    def read(self) -> list[Row]:
        """Return recording, id, decision and error of each record."""
        return self._history.known()

    def write(self, rows: Sequence[Row]) -> None:
        """Leave the history as it is: each record has a place of its own."""

    def append(self, row: Row) -> Row:
        """Write one record to the disk, and return what `read` will return of it."""
        self._history.write(row)
        return {name: row[name] for name in ("recording", "id", "decision", "error")}

    def write_features(self, identity: str, made_by: str, values: Any) -> None:
        """Write the features of a record; see `History.write_features`."""
        self._history.write_features(identity, made_by, values)

    def finish(self, rows: Sequence[Row]) -> None:
        """Leave the history as it is."""


class ResultTable:
    """Rows in a file, each written as soon as it is known.

    A parquet file cannot be appended to: until `finish`, its rows are in a text file in the same
    folder, whose name ends with ".jsonl".

    Parameters
    ----------
    path : Path
        A file that ends with .csv, .jsonl or .parquet.
    columns : sequence of str
        Columns, in this order.
    """

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        self.path, self.columns = path.resolve(), list(columns)
        self._parquet = path.suffix == ".parquet"
        self._written = Path(f"{self.path}.jsonl") if self._parquet else self.path
        self._as_json = self._written.suffix == ".jsonl"

    def read(self) -> list[Row]:
        """Return the rows that were written before; an incomplete last row is left out.

        Raises
        ------
        ValueError
            If the file is not a table of such results.
        """
        path = self._written if self._written.exists() else self.path
        if not path.exists() or not path.stat().st_size:
            return []
        try:
            return _rows_of(self._frame(path), self.columns)
        except (ValueError, TypeError, AttributeError) as error:
            raise ValueError(
                f"{path} is no table of these results: {error}. Choose another file for --out, or "
                f"delete it."
            ) from error

    def _frame(self, path: Path) -> pd.DataFrame:
        if path.suffix == ".parquet":
            return pd.read_parquet(path)
        text = path.read_bytes().decode("utf-8")  # line ends within names are kept
        complete = text[: text.rfind("\n") + 1]
        if not self._as_json:
            return pd.read_csv(io.StringIO(complete), dtype=str, keep_default_na=False).map(of_cell)
        return pd.DataFrame(map(json.loads, complete.split("\n")[:-1]))

    def write(self, rows: Sequence[Row]) -> None:
        """Write these rows in place of all others."""
        with written_whole(self._written) as unfinished:
            unfinished.write_bytes(self._content(rows, heading=True))

    def append(self, row: Row) -> Row:
        """Write one row to the disk, all of it or nothing with an error, and return it."""
        size = self._written.stat().st_size
        try:
            with open(self._written, "ab") as file:
                file.write(self._content([row]))
        except OSError as error:
            os.truncate(self._written, size)
            error.filename = str(self._written)
            raise
        return row

    def _content(self, rows: Sequence[Row], *, heading: bool = False) -> bytes:
        text = lines_of(rows, self.columns, as_json=self._as_json, heading=heading)
        return text.encode("utf-8", "backslashreplace")

    def finish(self, rows: Sequence[Row]) -> None:
        """Write these rows in place of all others, in the type of the file."""
        self.write(rows)
        if self._parquet:
            with written_whole(self.path) as unfinished:
                pd.DataFrame(rows, columns=self.columns).to_parquet(unfinished, index=False)
            self._written.unlink()


def lines_of(
    rows: Sequence[Row], columns: Sequence[str], *, as_json: bool = False, heading: bool = False
) -> str:
    """Return records as lines of JSON or CSV; numbers so that they are read back exactly."""
    table = [{name: row[name] for name in columns} for row in rows]
    if as_json:
        return "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in table)
    cells = [[*map(as_cell, row.values())] for row in table]
    frame = pd.DataFrame(cells, columns=columns, dtype=object)
    return frame.to_csv(index=False, header=heading, lineterminator="\n")


def _rows_of(frame: pd.DataFrame, columns: list[str]) -> list[Row]:
    if list(frame.columns) != columns:
        raise ValueError(f"it has other columns, {list(frame.columns)} instead of {columns}")
    frame = frame.astype(object)
    fields = SCHEMA["properties"]
    for name in columns:
        kinds = fields[name].get("type", "string") if name in fields else ("number", "null")
        known = frame[name].notna() & ((frame[name] != "") | ("null" not in kinds))
        if "number" in kinds:
            frame[name] = frame[name].where(known).astype(float).astype(object)
        frame[name] = frame[name].where(known, None if "null" in kinds else "")
    return frame.to_dict("records")
