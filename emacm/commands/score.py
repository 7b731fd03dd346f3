"""The command ``emacm score``: one row for each file, and an exit status."""

from __future__ import annotations

import argparse
import csv
import io
import json
import os
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pandas as pd

from emacm.commands.parsers import check_paths, expanded
from emacm.conditions.router import ConditionRouter
from emacm.decisions.pipelines import final_estimator
from emacm.files.folder import open_recording
from emacm.files.layout import Layout
from emacm.models.model_files import load_model
from emacm.models.scoring import check_model, score_columns, scored_rows
from emacm.recordings.digests import digest_of_file

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
        if self._parquet and not self._written.is_file() and self.path.is_file():
            return _rows_of(pd.read_parquet(self.path), self.columns, self.path)
        text = self._written.read_text(encoding="utf-8") if self._written.is_file() else ""
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
    frame[numbers] = frame[numbers].where(frame[numbers] != "").astype(object).astype(float)
    texts = [name for name in columns if name not in numbers]
    frame[texts] = frame[texts].astype(object).where(frame[texts].notna(), "")
    return frame.to_dict("records")


ALARM, FAILED = 1, 3  # exit status: a decision of --fail-on; files without a decision


def run(options: argparse.Namespace) -> int:
    """Decide on all files, and return the exit status.

    Returns
    -------
    int
        0; 1 if a decision of ``--fail-on`` was made; 3 if files failed.
    """
    if options.watch is not None and not options.watch > 0:
        raise ValueError(f"--watch must be a number of seconds above 0, got {options.watch}.")
    layout, model = Layout.from_toml(options.layout), load_model(options.model)
    check_model(model)
    set_costs(model, options.cost, options.priors)
    alarms = _alarms(model, options.fail_on)
    work = _Work(model, layout, options)
    if options.watch is None:
        check_paths(options.paths)
    while True:
        rows = work.once()
        if options.watch is None:
            break
        time.sleep(options.watch)
    if options.out is not None:
        print(_summary(rows, options.out))
    if any(row["decision"] in alarms for row in rows):
        return ALARM
    return FAILED if any(row["error"] for row in rows) else 0


class _Work:
    """The files to decide on, and the table of results."""

    def __init__(self, model: Any, layout: Layout, options: argparse.Namespace) -> None:
        self._model, self._layout, self._options = model, layout, options
        costs = options.cost.read_text(encoding="utf-8") if options.cost else None
        settings = (digest_of_file(options.model), layout.key, repr(layout.meta), costs)
        self._settings_digest = sha256(repr((*settings, options.priors)).encode()).hexdigest()
        self._columns = columns = [*score_columns(model), "digest"]
        self._reported = time.monotonic()
        self._table = None if options.out is None else ResultTable(options.out, columns)
        self._done: dict[tuple[str, str], Row] = {}
        self._reports: Any = None
        if options.report is not None:
            from emacm.commands.report import FileReports  # with the displays

            self._reports = FileReports(options, layout, options.report)
        if self._table is None:
            sys.stdout.write(
                line_of(dict(zip(columns, columns, strict=True)), columns, as_json=False)
            )
        elif not options.again:
            self._done = _without_errors(self._table.read())

    def once(self, at_once: int = 32) -> list[Row]:
        """Decide on the files that are new, `at_once` between two writes, and return all rows."""
        paths, rows = list(self._paths()), []
        if self._table is not None:
            self._table.start(self._done.values())
        for first in range(0, len(paths), at_once):
            rows += self._rows(paths[first : first + at_once])
            self._report(len(rows), len(paths))
        names = {row["recording"] for row in rows}
        others = [row for row in self._done.values() if row["recording"] not in names]
        is_new = [(row["recording"], row["digest"]) not in self._done for row in rows]
        self._done = {(row["recording"], row["digest"]): row for row in [*rows, *others]}
        if self._table is not None:
            self._table.finish([*rows, *others])
        if self._reports is not None and rows:
            self._reports.update(pd.DataFrame(rows), is_new)
        return rows

    def _paths(self, settled: float = 2.0) -> Iterator[Path]:
        """Yield the files; with --watch, one changed in the last seconds may be incomplete."""
        now = time.time()
        for path in expanded(self._options.paths):
            written = path.stat().st_mtime if path.is_file() else 0.0
            if self._options.watch is None or now - written > settled:
                yield path

    def _digest(self, path: Path) -> str:
        """Return the digest of a file and of the settings; "" for a file that is not there."""
        try:
            digest = digest_of_file(path)
        except OSError:
            return ""
        return sha256(f"{self._settings_digest}{digest}".encode()).hexdigest()[:32]

    def _rows(self, paths: Sequence[Path]) -> list[Row]:
        """Return the rows of some files in order; those that are new are written."""
        digests = [self._digest(path) for path in paths]
        known = [self._done.get((str(p), d)) for p, d in zip(paths, digests, strict=True)]
        new = [i for i, row in enumerate(known) if row is None]
        sources = [partial(open_recording, paths[i], self._layout) for i in new]
        names = [str(paths[i]) for i in new]
        scored = scored_rows(self._model, sources, names, self._options.jobs)
        for i, row in zip(new, scored, strict=True):
            row = {k: "" if v is None else v for k, v in row.items()} | {"digest": digests[i]}
            known[i] = row
            if self._table is not None:
                self._table.append(row)
            else:
                sys.stdout.write(line_of(row, self._columns, as_json=False))
                sys.stdout.flush()
        return [row for row in known if row is not None]

    def _report(self, done: int, total: int, every: float = 5.0) -> None:
        """Report the progress, at most once in some seconds."""
        if time.monotonic() - self._reported > every:
            self._reported = time.monotonic()
            print(f"{done} of {total} files", file=sys.stderr)


def _without_errors(rows: Sequence[Row]) -> dict[tuple[str, str], Row]:
    """Return the rows with a decision, by file and digest; files that failed are tried again."""
    return {(row["recording"], row["digest"]): row for row in rows if not row["error"]}


def set_costs(model: Any, cost: Path | None, priors: str | None) -> None:
    """Set costs from a table and priors from a text on a model, fitted or not.

    Raises
    ------
    ValueError
        If they do not fit the model.
    """
    final = final_estimator(model)
    while isinstance(final, ConditionRouter):
        final = final_estimator(final.estimator)
    given: dict[str, Any] = {}
    if cost is not None:
        given["cost"] = pd.read_csv(cost, index_col=0)
    if priors is not None:
        given["priors"] = priors if priors == "uniform" else _priors(priors)
    if given:
        final.set_params(**given)
    if hasattr(model, "classes_") and hasattr(final, "cost"):
        _ = (final if not hasattr(model, "cost_") else model).cost_, getattr(final, "priors_", None)


def _priors(text: str) -> dict[str, float]:
    pairs = [part.rpartition("=") for part in text.split(",")]
    try:
        return {name.strip(): float(value) for name, _, value in pairs}
    except ValueError as error:
        raise ValueError(
            f"--priors must be 'uniform' or as in healthy=0.9,worn=0.1; got {text!r}."
        ) from error


def _alarms(model: Any, text: str) -> set[Any]:
    """Return the decisions of ``--fail-on``, as the model has them."""
    known = getattr(model, "decisions_", None)
    if known is None:
        known = getattr(final_estimator(model), "decisions_", model.classes_)
    decisions = {str(label): label for label in np.asarray(known).tolist()}
    wanted = [name.strip() for name in text.split(",") if name.strip()]
    for name in wanted:
        if name not in decisions:
            raise ValueError(f"--fail-on names {name!r}; the decisions are {list(decisions)}.")
    return {*wanted, *(decisions[name] for name in wanted)}


def _summary(rows: Sequence[Row], out: Path) -> str:
    failed = sum(bool(row["error"]) for row in rows)
    counts = pd.Series([row["decision"] for row in rows if not row["error"]], dtype=object)
    parts = [f"{count} {name}" for name, count in counts.value_counts().items()]
    parts += [f"{failed} failed"] if failed else []
    return f"{len(rows)} files: {', '.join(parts)}. Table: {out}"
