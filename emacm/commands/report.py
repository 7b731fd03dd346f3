"""The command ``emacm report``, and the reports of ``emacm score``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from emacm.commands.find import parts_of_options
from emacm.commands.loaded_model import loaded_model
from emacm.commands.result_tables import print_json
from emacm.files.folder import RecordingFolder, open_recording, recording_files
from emacm.files.layout import Layout
from emacm.history.records import record_of, times_of
from emacm.history.sqlite_history import History, is_history
from emacm.recordings.names import printable
from emacm.reports import inputs
from emacm.reports.facts import model_facts, when
from emacm.reports.fleet import write_fleet
from emacm.reports.maintenance import Reports, add_since, read_settings
from emacm.reports.pages import Page


def run(options: argparse.Namespace) -> int:
    """Write the reports of files.

    Returns
    -------
    int
        0; 3 if there is no decision on some of the files, whose pages state why.
    """
    layout = Layout.from_toml(options.layout)
    paths = recording_files(options.paths, layout, options.pattern)
    reports = FileReports(options, layout, options.out, *loaded_model(options, layout))
    history = None if options.history is None else inputs.read_results(options.history)
    last, rows = reports.write(paths, history)
    print(f"{len(paths)} reports: {printable(last)}", file=sys.stderr if options.json else None)
    if options.json:
        print_json(pd.DataFrame(rows))
    return 3 if any(row["error"] for row in rows) else 0


class FileReports:
    """Reports of files, with the options of the command line.

    Parameters
    ----------
    options : Namespace
        With model, cost, priors, actions, parts, unit and time.
    layout : Layout
        Of the files.
    out : Path
        Folder, or a file that ends with .html.
    model, healthy
        Those of `loaded_model`.
    """

    def __init__(
        self,
        options: argparse.Namespace,
        layout: Layout,
        out: Path,
        model: Any,
        healthy: RecordingFolder | None,
    ) -> None:
        actions = None if options.actions is None else inputs.read_actions(options.actions)
        parts = parts_of_options(options) or None
        settings = read_settings(model, actions, parts, background=healthy)
        facts = model_facts(model, options.model)
        facts += [("Costs", f"of {options.cost}")] if options.cost else []
        facts += [("Priors", options.priors)] if options.priors else []
        self._reports = Reports(replace(settings, facts=facts), out)
        self._layout, self._unit, self._time = layout, options.unit, options.time
        self._out = out
        self._results = options.history if options.command == "report" else options.out
        self._has_fleet = False

    def write(
        self, paths: Sequence[Path], history: pd.DataFrame | None
    ) -> tuple[Path, list[dict[str, Any]]]:
        """Write the pages of files; return the last one, and their rows."""
        pages = self._pages(paths, history)
        rows = [] if history is None or is_history(self._results) else history.to_dict("records")
        made = [{**page.row, "unit": page.unit} for page in pages]
        rows += made
        self._has_fleet = self._with_fleet(row.get("unit") for row in rows)
        files = self._reports.write(pages, has_fleet=self._has_fleet)
        self.write_fleet(rows)
        return files[-1], made

    def update(self, rows: pd.DataFrame, at_once: int = 8) -> None:
        """Write the pages of new results, and an index of all.

        Parameters
        ----------
        rows : DataFrame
            All results of files, with the columns "path", whose name may not be printable, and
            "is_new"; those without a page are taken as well.
        at_once : int
            Number of pages between two writes.
        """
        self._has_fleet = self._with_fleet(rows.get("unit", ()))
        missing = self._reports.missing(rows["recording"].tolist(), rows["id"].tolist())
        wanted = np.flatnonzero(rows["is_new"].to_numpy() | missing)
        at_once = len(rows) if self._reports.is_file else at_once
        for first in range(0, len(wanted), at_once):
            part = rows.iloc[wanted[first : first + at_once]]
            others = rows.drop(part.index)
            history = others.assign(recording=others["path"]) if self._unit else None
            pages = self._pages(part["path"].tolist(), history)
            for page, digest in zip(pages, part["id"], strict=True):
                page.digest = digest
            before = others["recording"].tolist()
            self._reports.write(pages, before, has_fleet=self._has_fleet)

    def write_fleet(self, rows: Iterable[Mapping[str, Any]] = ()) -> None:
        """Write the page of the fleet, of a history and of rows that it may not have."""
        if not self._has_fleet:
            return
        records, alarms = [], []
        if is_history(self._results):
            history = History(self._results)
            records, alarms = history.last_records(30), history.alarms(open_only=True)
            history.close()
        known = {(record["recording"], record["end"]) for record in records}
        new = [record_of(row) for row in rows]
        records += [one for one in new if (one["recording"], one["end"]) not in known]
        write_fleet(self._out, records, alarms, healthy=self._reports.healthy)

    def _with_fleet(self, units: Iterable[Any]) -> bool:
        """Tell whether there is a page of the fleet: of a history, or if units are known."""
        return not self._reports.is_file and (is_history(self._results) or any(units))

    def _pages(self, paths: Sequence[Path], history: pd.DataFrame | None) -> list[Page]:
        layout, unit = self._layout, self._unit
        sources = [partial(open_recording, path, layout) for path in paths]
        units = times = None
        if unit is not None or history is not None:
            units, times = inputs.units_and_times(paths, layout, unit, self._time)
        if history is not None:
            history = inputs.with_units_and_times(history, layout, unit, self._time)
        names = [printable(path) for path in paths]
        pages = self._reports.pages(sources, names, partial(times_of, key=self._time))
        for page, path in zip(pages, paths, strict=True):
            page.unit = page.unit or inputs.unit_named(path, layout, unit)
        if self._time is None:  # without a start, it is the time at which the file was written
            for page, time in zip(pages, times or [], strict=False):
                page.date = page.date or f"{when(time)} UTC (file time)"
        for page in pages if times is None else ():  # as on the page of the fleet
            if not page.date and page.row.get("end") is not None:
                of_file = " (file time)" if page.row["times"] == "modified" else ""
                page.date = f"{when(page.row['end'])} UTC{of_file}"
        add_since(pages, history, units, times, self._time or "")
        return pages
