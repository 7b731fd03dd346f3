"""The tables of ``emacm score``, which hold a record for each file and are continued."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from sklearn.pipeline import Pipeline

from emacm._saved import write_whole, written_whole
from emacm.history.records import SCHEMA, record_of
from emacm.history.sqlite_history import History, is_history
from emacm.models.scoring import score_columns
from emacm.recordings.digests import model_digest
from emacm.reports.inputs import as_cell, of_cell

Row = dict[str, Any]


def print_json(table: pd.DataFrame, **others: Any) -> None:
    """Print the rows of a table as JSON; with others, an object that has them as "rows".

    What is no finite number is null, dates are in ISO 8601.
    """
    rows = json.loads(table.to_json(orient="records", date_format="iso", double_precision=15))
    print(json.dumps({**others, "rows": rows} if others else rows, ensure_ascii=False))


def save_table(table: pd.DataFrame, path: Path) -> None:
    """Write a table as CSV, all of it or nothing."""
    with written_whole(path) as unfinished:
        table.map(as_cell).to_csv(unfinished, index=False)


def save_picture(figure: Any, path: Path) -> None:
    """Write a figure in the form that its name states, all of it or nothing."""
    with written_whole(path) as unfinished:
        figure.savefig(unfinished, dpi=150, format=path.suffix[1:] or "png")


def result_table(
    path: Path | None, model: Any, *, with_features: bool = False, as_json: bool = False
) -> ResultTable | HistoryTable:
    """Return the table in a file, or on the standard output.

    Parameters
    ----------
    path : Path or None
        A file that ends with .csv, .jsonl, .sqlite or .db.
    model : estimator
        Fitted classifier.
    with_features : bool
        Whether a history also stores the features of each recording.
    as_json : bool
        Whether what is printed are lines of JSON, not CSV.

    Raises
    ------
    ValueError
        If the name of the file has another suffix, or there is no place for features.
    """
    if with_features and not (is_history(path) and isinstance(model, Pipeline)):
        raise ValueError(
            "--features needs --out FILE.sqlite, and a pipeline that ends with the classifier."
        )
    if path is None:
        return ResultTable(None, model, as_json=as_json)
    if is_history(path):
        return HistoryTable(path, model_digest(model[:-1]) if with_features else None)
    if path.suffix not in (".csv", ".jsonl"):
        raise ValueError(f"{str(path)!r} must end with one of .csv, .jsonl, .sqlite.")
    return ResultTable(path, model, as_json=path.suffix == ".jsonl")


class ResultTable:
    """Rows in a file, or on the standard output, each written as soon as it is known.

    Parameters
    ----------
    path : Path or None
        The file; None if rows are printed.
    model : estimator
        Fitted classifier, from which the columns follow: those of `score`, and the other fields of
        a record.
    as_json : bool
        Whether a row is a line of JSON, which is a record, or of CSV, without fields of streams.
    """

    def __init__(self, path: Path | None, model: Any, *, as_json: bool) -> None:
        self.path = None if path is None else path.resolve()
        self._as_json = as_json
        first = score_columns(model)
        left_out = () if as_json else ("alarms", "stream_start", "stream_end")
        self._columns = [*first, *(n for n in record_of({}) if n not in (*first, *left_out))]
        if path is None:
            print(self._text([], heading=True), end="")

    def read(self) -> list[Row]:
        """Return the rows that were written before; an incomplete last row is left out.

        Raises
        ------
        ValueError
            If the file is not a table of such results.
        """
        if self.path is None or not self.path.exists() or not self.path.stat().st_size:
            return []
        try:
            text = self.path.read_bytes().decode("utf-8")  # line ends within names are kept
            return self._rows(text[: text.rfind("\n") + 1])
        except (ValueError, TypeError, AttributeError) as error:
            raise ValueError(
                f"{self.path} is no table of these results: {error}. Choose another file for --out."
            ) from error

    def write(self, rows: Sequence[Row]) -> None:
        """Write these rows in place of all others, in a file."""
        if self.path is not None:
            write_whole(self.path, _encoded(self._text(rows, heading=True)))

    def append(self, row: Row, features: Any) -> Row:
        """Write one row, and return what `read` will return of it.

        In a file, it is on the disk then, all of it or nothing with an error.
        """
        text = self._text([row])
        if self.path is None:
            print(text, end="", flush=True)
            return row
        size = self.path.stat().st_size
        try:
            with open(self.path, "ab") as file:
                file.write(_encoded(text))
        except OSError as error:
            os.truncate(self.path, size)
            error.filename = str(self.path)
            raise
        return row

    def _text(self, rows: Sequence[Row], *, heading: bool = False) -> str:
        """Return records as lines of JSON or CSV; numbers so that they are read back exactly."""
        if self._as_json:
            table = [{name: row[name] for name in self._columns} for row in rows]
            return "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in table)
        frame = pd.DataFrame(rows, columns=self._columns, dtype=object).map(as_cell)
        return frame.to_csv(index=False, header=heading, lineterminator="\n")

    def _rows(self, text: str) -> list[Row]:
        """Return the records of lines."""
        if self._as_json:
            frame = pd.DataFrame(map(json.loads, text.split("\n")[:-1]))
        else:
            cells = pd.read_csv(io.StringIO(text), dtype=str, keep_default_na=False)
            frame = cells.map(of_cell)
        if list(frame.columns) != self._columns:
            raise ValueError(f"its columns are {list(frame.columns)}, not {self._columns}")
        frame = frame.astype(object)
        fields = SCHEMA["properties"]
        for name in self._columns:
            kinds = fields[name].get("type", "string") if name in fields else ("number", "null")
            known = frame[name].notna() & ((frame[name] != "") | ("null" not in kinds))
            if "number" in kinds:
                frame[name] = frame[name].where(known).astype(float).astype(object)
            frame[name] = frame[name].where(known, None if "null" in kinds else "")
        return frame.to_dict("records")


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", "backslashreplace")


class HistoryTable:
    """A history as a table that is never read as a whole: only names, decisions and errors are.

    The features are stored under the digest of the steps that made them, if it is given.
    """

    def __init__(self, path: Path, made_by: str | None) -> None:
        self.path, self._history, self._made_by = path.resolve(), History(path), made_by

    def read(self) -> list[Row]:
        """Return recording, id, decision and error of each record; with its features, if wanted."""
        return self._history.known(self._made_by)

    def write(self, rows: Sequence[Row]) -> None:
        """Leave all as it is: a history has no order."""

    def append(self, row: Row, features: Any) -> Row:
        """Write one record to the disk."""
        self._history.write(row)
        if self._made_by and not row["error"]:
            self._history.write_features(row["id"], self._made_by, features)
        return {name: row[name] for name in ("recording", "id", "decision", "error")}
