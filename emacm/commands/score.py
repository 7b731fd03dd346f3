"""The command ``emacm score``: one row for each file, and an exit status."""

from __future__ import annotations

import argparse
import io
import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from joblib import effective_n_jobs

from emacm._saved import locked, written_whole
from emacm.commands.paths import expanded
from emacm.conditions.router import ConditionRouter
from emacm.decisions.pipelines import final_estimator
from emacm.files.folder import open_recording
from emacm.files.layout import Layout
from emacm.models.model_files import load_model
from emacm.models.scoring import check_model, score_columns, scored_rows
from emacm.recordings.digests import digest_of_file
from emacm.recordings.names import printable
from emacm.reports.facts import decisions_of
from emacm.reports.inputs import as_cell, of_cell

Row = dict[str, Any]


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
        If the name of the file has another suffix.
    """

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        if path.suffix not in (".csv", ".jsonl", ".parquet"):
            raise ValueError(f"{str(path)!r} must end with one of .csv, .jsonl, .parquet.")
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

    def append(self, row: Row) -> None:
        """Write one row to the disk; all of it, or nothing with an error."""
        size = self._written.stat().st_size
        try:
            with open(self._written, "ab") as file:
                file.write(self._content([row]))
        except OSError as error:
            os.truncate(self._written, size)
            error.filename = str(self._written)
            raise

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
    """Return rows as lines of JSON or CSV; numbers so that they are read back exactly."""
    table = [{name: _plain(row.get(name)) for name in columns} for row in rows]
    if as_json:
        return "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in table)
    cells = [[*map(as_cell, row.values())] for row in table]
    frame = pd.DataFrame(cells, columns=columns, dtype=object)
    return frame.to_csv(index=False, header=heading, lineterminator="\n")


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None if np.isnan(value) else str(value)
    return value if value is None or isinstance(value, str | int | float) else str(value)


def _rows_of(frame: pd.DataFrame, columns: list[str]) -> list[Row]:
    if list(frame.columns) != columns:
        raise ValueError(f"it has other columns, {list(frame.columns)} instead of {columns}")
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
    layout, model = Layout.from_toml(options.layout), load_model(options.model)
    check_model(model)
    set_costs(model, options.cost, options.priors)
    alarms = _alarms(model, options.fail_on)
    expanded(options.paths, layout, options.pattern, may_be_empty=options.watch is not None)
    with nullcontext() if options.out is None else locked(options.out.resolve()):
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
        else:
            for row in self._table.read():
                if not row["error"]:  # files that failed are tried again
                    self._done[row["recording"], "" if options.again else row["digest"]] = row

    def once(self) -> list[Row]:
        """Decide on the files that are new, and return all rows."""
        paths = list(self._paths())
        if self._table is not None:
            self._table.write([*self._done.values()])
        rows = self._rows(paths)
        names = {row["recording"] for row in rows}
        others = [row for row in self._done.values() if row["recording"] not in names]
        is_new = [(row["recording"], row["digest"]) not in self._done for row in rows]
        self._done = {(row["recording"], row["digest"]): row for row in [*rows, *others]}
        if self._table is not None:
            self._table.finish([*rows, *others])
        if self._reports is not None and rows:
            self._reports.update(pd.DataFrame(rows).assign(path=paths, is_new=is_new))
        return rows

    def _paths(self, settled: float = 2.0) -> Iterator[Path]:
        """Yield the files but the table; with --watch, one changed just now may be incomplete."""
        now, table = time.time(), None if self._table is None else self._table.path
        options = self._options
        for path in expanded(options.paths, self._layout, options.pattern, may_be_empty=True):
            written = path.stat().st_mtime if path.is_file() else 0.0
            is_settled = options.watch is None or abs(now - written) > settled
            if is_settled and path.resolve() != table:
                yield path

    def _digest(self, path: Path) -> str:
        """Return the digest of a file and of the settings; "" for a file that is not there."""
        try:
            digests = map(digest_of_file, self._layout.files_of(path))
            text = "".join([self._settings_digest, *digests])
        except (OSError, ValueError):
            return ""
        return sha256(text.encode()).hexdigest()[:32]

    def _rows(self, paths: Sequence[Path], most: int = 32, quick: float = 1.0) -> list[Row]:
        """Return the rows of files in order; those of new ones are written batch by batch.

        A batch grows up to `most` files while one takes less than `quick` seconds: little is lost
        by a kill.
        """
        rows: list[Row] = []
        new: list[tuple[Path, Row]] = []
        at_once = effective_n_jobs(self._options.jobs)
        for number, path in enumerate(paths, 1):
            key = printable(path), self._digest(path)
            rows.append(self._done.get(key) or {"recording": key[0], "digest": key[1]})
            if key not in self._done:
                new.append((path, rows[-1]))
            if len(new) >= at_once or number == len(paths):
                started = time.monotonic()
                self._decide(new)
                if time.monotonic() - started < quick:
                    at_once = max(at_once, min(2 * at_once, most))
                new = []
                self._report(number, len(paths))
        return rows

    def _decide(self, new: Sequence[tuple[Path, Row]]) -> None:
        """Fill the rows of new files, and write them."""
        sources = [partial(open_recording, path, self._layout) for path, _ in new]
        names = [row["recording"] for _, row in new]
        scored = scored_rows(self._model, sources, names, self._options.jobs)
        for (_, row), found in zip(new, scored, strict=True):
            row.update({k: "" if v is None else v for k, v in found.items()})
            if self._table is not None:
                self._table.append(row)
            else:
                print(lines_of([row], self._columns), end="", flush=True)

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
    return f"{len(rows)} files: {', '.join(parts)}. Table: {printable(out)}"
