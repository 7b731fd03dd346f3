"""Tables of results that are written row by row, and continued after an interruption."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pandas as pd

Row = dict[str, Any]

SUFFIXES = (".csv", ".jsonl", ".parquet")


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

    Raises
    ------
    ValueError
        If the name of the file has another suffix, or an existing file has other columns.
    """

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        if path.suffix not in SUFFIXES:
            raise ValueError(f"{str(path)!r} must end with one of {', '.join(SUFFIXES)}.")
        self.path, self.columns = path, list(columns)
        self._parquet = path.suffix == ".parquet"
        self._written = path.with_name(path.name + ".jsonl") if self._parquet else path
        self._as_lines = self._written.suffix == ".jsonl"
        self._file: TextIO | None = None

    def read(self) -> list[Row]:
        """Return the rows that were written before; an incomplete last row is left out."""
        if self._parquet and not self._written.is_file():
            if not self.path.is_file():
                return []
            return _rows_of(pd.read_parquet(self.path), self.columns, self.path)
        if not self._written.is_file():
            return []
        text = self._written.read_text(encoding="utf-8")
        complete = text[: text.rfind("\n") + 1]
        if not complete:
            return []
        if self._as_lines:
            frame = pd.DataFrame([json.loads(line) for line in complete.splitlines()])
        else:
            frame = pd.read_csv(io.StringIO(complete), dtype=str, keep_default_na=False)
        return _rows_of(frame, self.columns, self.path)

    def start(self, rows: Iterable[Row]) -> None:
        """Begin the file with these rows."""
        unfinished = self._written.with_name(f".{self._written.name}.{os.getpid()}.part")
        with open(unfinished, "w", encoding="utf-8", newline="") as file:
            if not self._as_lines:
                csv.writer(file, lineterminator="\n").writerow(self.columns)
            file.writelines(self._line(row) for row in rows)
        os.replace(unfinished, self._written)
        self._file = open(self._written, "a", encoding="utf-8", newline="")  # noqa: SIM115

    def append(self, row: Row) -> None:
        """Write one row to the disk."""
        assert self._file is not None, "start the table first"
        self._file.write(self._line(row))
        self._file.flush()

    def finish(self, rows: Sequence[Row]) -> None:
        """Write these rows in place of all others, and close the file."""
        if self._file is not None:
            self._file.close()
        self.start(rows)
        assert self._file is not None
        self._file.close()
        if self._parquet:
            frame = pd.DataFrame(list(rows), columns=self.columns)
            unfinished = self.path.with_name(f".{self.path.name}.{os.getpid()}.part")
            frame.to_parquet(unfinished, index=False)
            os.replace(unfinished, self.path)
            self._written.unlink()

    def _line(self, row: Row) -> str:
        return line_of(row, self.columns, as_json=self._as_lines)


def line_of(row: Row, columns: Sequence[str], *, as_json: bool) -> str:
    """Return a row as one line of JSON or CSV; numbers so that they are read back exactly."""
    values = {name: _plain(row.get(name)) for name in columns}
    if as_json:
        return json.dumps(values, ensure_ascii=False) + "\n"
    buffer = io.StringIO()
    texts = ["" if value is None else value for value in values.values()]
    csv.writer(buffer, lineterminator="\n").writerow(texts)
    return buffer.getvalue()


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None if np.isnan(value) else str(value)
    return value if value is None or isinstance(value, str | int | float) else str(value)


def _rows_of(frame: pd.DataFrame, columns: list[str], path: Path) -> list[Row]:
    if list(frame.columns) != columns:
        raise ValueError(
            f"{path} has other columns than these results: {list(frame.columns)} instead of "
            f"{columns}. Choose another file for --out, or delete it."
        )
    numbers = [n for n in columns if n in ("expected_cost", "typicality") or n.startswith("P(")]
    for name in numbers:
        # float() and not pd.to_numeric, which may change the last digit of a text.
        frame[name] = [
            float(value) if pd.notna(value) and value != "" else float("nan")
            for value in frame[name]
        ]
    texts = [name for name in columns if name not in numbers]
    frame[texts] = frame[texts].astype(object).where(frame[texts].notna(), "")
    return frame.to_dict("records")
