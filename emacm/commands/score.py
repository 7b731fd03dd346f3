"""The command ``emacm score``: one row for each file, and an exit status."""

from __future__ import annotations

import argparse
import io
import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from emacm.commands.parsers import expanded
from emacm.conditions.router import ConditionRouter
from emacm.decisions.pipelines import final_estimator
from emacm.files.folder import open_recording
from emacm.files.layout import Layout
from emacm.models.model_files import load_model
from emacm.models.scoring import check_model, score_columns, scored_rows
from emacm.recordings.digests import digest_of_file
from emacm.reports.facts import decisions_of

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
        self._as_json = self._written.suffix == ".jsonl"

    def read(self) -> list[Row]:
        """Return the rows that were written before; an incomplete last row is left out."""
        if self._parquet and not self._written.is_file() and self.path.is_file():
            return _rows_of(pd.read_parquet(self.path), self.columns, self.path)
        text = self._written.read_text(encoding="utf-8") if self._written.is_file() else ""
        complete = text[: text.rfind("\n") + 1]
        if not complete:
            return []
        if self._as_json:
            frame = pd.DataFrame([json.loads(line) for line in complete.splitlines()])
        else:
            frame = pd.read_csv(io.StringIO(complete), dtype=str, keep_default_na=False)
        return _rows_of(frame, self.columns, self.path)

    def write(self, rows: Sequence[Row]) -> None:
        """Write these rows in place of all others."""
        text = lines_of(rows, self.columns, as_json=self._as_json, heading=True)
        with _in_place_of(self._written) as unfinished:
            unfinished.write_text(text, encoding="utf-8", newline="")

    def append(self, row: Row) -> None:
        """Write one row to the disk."""
        with open(self._written, "a", encoding="utf-8", newline="") as file:
            file.write(lines_of([row], self.columns, as_json=self._as_json))

    def finish(self, rows: Sequence[Row]) -> None:
        """Write these rows in place of all others, in the type of the file."""
        self.write(rows)
        if self._parquet:
            with _in_place_of(self.path) as unfinished:
                pd.DataFrame(rows, columns=self.columns).to_parquet(unfinished, index=False)
            self._written.unlink()


@contextmanager
def _in_place_of(path: Path) -> Iterator[Path]:
    """Yield a file to be written, which then replaces another one as a whole."""
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.part")
    yield unfinished
    os.replace(unfinished, path)


def lines_of(
    rows: Sequence[Row], columns: Sequence[str], *, as_json: bool = False, heading: bool = False
) -> str:
    """Return rows as lines of JSON or CSV; numbers so that they are read back exactly."""
    table = [{name: _plain(row.get(name)) for name in columns} for row in rows]
    if as_json:
        return "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in table)
    frame = pd.DataFrame(table, columns=columns, dtype=object)
    return frame.to_csv(index=False, header=heading, lineterminator="\n")


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
    expanded(options.paths, may_be_empty=options.watch is not None)
    work = _Work(model, layout, options)
    rows = work.once()
    while options.watch is not None:
        time.sleep(options.watch)
        rows = work.once()
    if options.out is not None:
        print(_summary(rows, options.out))
    if any(str(row["decision"]) in alarms for row in rows):
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
            print(lines_of([], columns, heading=True), end="")
        elif not options.again:
            rows = self._table.read()  # files that failed are tried again
            self._done = {(r["recording"], r["digest"]): r for r in rows if not r["error"]}

    def once(self, at_once: int = 32) -> list[Row]:
        """Decide on the files that are new, `at_once` between two writes, and return all rows."""
        paths, rows = list(self._paths()), []
        if self._table is not None:
            self._table.write([*self._done.values()])
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
        for path in expanded(self._options.paths, may_be_empty=True):
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
                print(lines_of([row], self._columns), end="", flush=True)
        return [row for row in known if row is not None]

    def _report(self, done: int, total: int, every: float = 5.0) -> None:
        """Report the progress, at most once in some seconds."""
        if time.monotonic() - self._reported > every:
            self._reported = time.monotonic()
            print(f"{done} of {total} files", file=sys.stderr)


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
    if cost is not None:
        final.set_params(cost=pd.read_csv(cost, index_col=0))
    if priors is not None:
        final.set_params(priors=priors if priors == "uniform" else _priors(priors))
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


def _alarms(model: Any, text: str) -> set[str]:
    """Return the decisions of ``--fail-on``."""
    decisions = [str(label) for label in decisions_of(model)]
    wanted = {name.strip() for name in text.split(",") if name.strip()}
    for name in wanted.difference(decisions):
        raise ValueError(f"--fail-on names {name!r}; the decisions are {decisions}.")
    return wanted


def _summary(rows: Sequence[Row], out: Path) -> str:
    failed = sum(bool(row["error"]) for row in rows)
    counts = pd.Series([row["decision"] for row in rows if not row["error"]], dtype=object)
    parts = [f"{count} {name}" for name, count in counts.value_counts().items()]
    parts += [f"{failed} failed"] if failed else []
    return f"{len(rows)} files: {', '.join(parts)}. Table: {out}"
