"""The command ``emacm score``: one row for each file, and an exit status."""

from __future__ import annotations

import argparse
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

from emacm._saved import locked
from emacm.commands.loaded_model import loaded_model
from emacm.commands.result_tables import Row, result_table
from emacm.files.folder import open_recording, recording_files
from emacm.files.layout import Layout
from emacm.history.records import identity, record_of, times_of
from emacm.history.sqlite_history import is_history
from emacm.models.model_files import model_description
from emacm.models.scoring import batch_statements, scored_rows
from emacm.recordings.digests import digest_of_file, model_digest
from emacm.recordings.names import printable
from emacm.reports.facts import decisions_of
from emacm.reports.inputs import unit_named

ALARM, FAILED = 1, 3  # exit status: a decision of --fail-on; files without a decision


def run(options: argparse.Namespace) -> int:
    """Decide on all files, and return the exit status.

    Returns
    -------
    int
        0; 1 if a decision of ``--fail-on`` was made, also if files failed; 3 if files failed.
    """
    layout = Layout.from_toml(options.layout)
    model, healthy = loaded_model(options, layout)
    alarms = _alarms(model, options.fail_on)
    recording_files(options.paths, layout, options.pattern, may_be_empty=options.watch is not None)
    with nullcontext() if options.out is None else locked(options.out.resolve()):
        work = _Work(model, healthy, layout, options)
        rows = work.once()
        while options.watch is not None:
            time.sleep(options.watch)
            rows = work.once()
    for statement in batch_statements([row.get("typicality") or np.nan for row in rows]):
        print(f"emacm: WARNING: {statement}.", file=sys.stderr)
    if options.out is not None:
        print(_summary(rows, options.out))
    if any(str(row["decision"]) in alarms for row in rows):
        return ALARM
    return FAILED if any(row["error"] for row in rows) else 0


class _Work:
    """The files to decide on, and the table of results."""

    def __init__(
        self, model: Any, healthy: Any, layout: Layout, options: argparse.Namespace
    ) -> None:
        self._model, self._layout, self._options = model, layout, options
        digest = model_digest(model)
        costs = options.cost.read_text(encoding="utf-8") if options.cost else None
        used = digest_of_file(options.model) + ("" if options.healthy is None else digest)
        settings = (used, layout.key, repr(layout.meta), costs)
        self._settings_digest = sha256(repr((*settings, options.priors)).encode()).hexdigest()
        note = model_description(options.model)["note"] or ""
        self._same = {"model": digest, "model_note": note}
        self._reported = time.monotonic()
        how = {"with_features": options.features, "as_json": options.json}
        self._table = result_table(options.out, model, **how)
        self._reports: Any = None
        if options.report is not None:
            from emacm.commands.report import FileReports  # with the displays

            self._reports = FileReports(options, layout, options.report, model, healthy)
        self._done = {
            (row["recording"], "" if options.again else row["id"]): row
            for row in self._table.read()
            if not row["error"]  # files that failed are tried again
        }

    def once(self) -> list[Row]:
        """Decide on the files that are new, and return all rows."""
        paths = list(self._paths())
        self._table.write([*self._done.values()])
        rows = self._rows(paths)
        names = {row["recording"] for row in rows}
        others = [row for row in self._done.values() if row["recording"] not in names]
        is_new = [(row["recording"], row["id"]) not in self._done for row in rows]
        self._done = {(row["recording"], row["id"]): row for row in [*rows, *others]}
        self._table.write([*rows, *others])
        if self._reports is not None and rows:
            self._reports.update(pd.DataFrame(rows).assign(path=paths, is_new=is_new))
            self._reports.write_fleet(() if is_history(self._options.out) else self._done.values())
        return rows

    def _paths(self) -> Iterator[Path]:
        """Yield the files but the table; with --watch, one changed just now may be incomplete."""
        now, options = time.time(), self._options
        paths = recording_files(options.paths, self._layout, options.pattern, may_be_empty=True)
        for path in paths:
            written = path.stat().st_mtime if path.is_file() else 0.0
            is_settled = options.watch is None or abs(now - written) > 2.0
            if is_settled and path.resolve() != self._table.path:
                yield path

    def _identity(self, path: Path) -> str:
        """Return the identity of name, content and settings; "" for a file that is not there."""
        try:
            digests = map(digest_of_file, self._layout.files_of(path))
            return identity([self._settings_digest, printable(path), *digests])
        except (OSError, ValueError):
            return ""

    def _rows(self, paths: Sequence[Path]) -> list[Row]:
        """Return the rows of files in order; those of new ones are written batch by batch.

        A batch grows up to 32 files while one takes less than a second: little is lost by a kill.
        """
        rows: list[Row] = []
        new: list[tuple[Path, Row]] = []
        at_once = effective_n_jobs(self._options.jobs)
        for number, path in enumerate(paths, 1):
            key = printable(path), self._identity(path)
            rows.append(self._done.get(key) or {"recording": key[0], "id": key[1]})
            if key not in self._done:
                new.append((path, rows[-1]))
            if len(new) >= at_once or number == len(paths):
                started = time.monotonic()
                self._decide(new)
                if time.monotonic() - started < 1.0:
                    at_once = max(at_once, min(2 * at_once, 32))
                new = []
                if time.monotonic() - self._reported > 5.0:  # seconds
                    self._reported = time.monotonic()
                    print(f"{number} of {len(paths)} files", file=sys.stderr)
        return rows

    def _decide(self, new: Sequence[tuple[Path, Row]]) -> None:
        """Fill the rows of new files, and write them."""
        sources = [partial(open_recording, path, self._layout) for path, _ in new]
        names = [row["recording"] for _, row in new]
        with_times = partial(times_of, key=self._options.time)
        scored = scored_rows(self._model, sources, names, self._options.jobs, facts=with_times)
        for (path, row), found in zip(new, scored, strict=True):
            record = record_of(
                found,
                unit=unit_named(path, self._layout, self._options.unit),
                id=row["id"],
                **self._same,
            )
            row.update(self._table.append(record, found.get("features")))


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
