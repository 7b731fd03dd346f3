"""The command ``emacm trend``: health index of each unit over time, from files."""

from __future__ import annotations

import argparse
import sys

import pandas as pd
from sklearn.pipeline import make_pipeline

from emacm.commands.paths import check_paths, expanded
from emacm.commands.train import extent, order_levels
from emacm.monitoring.health_index import HealthIndex
from emacm.monitoring.health_trend import health_trend
from emacm.recordings.files import RecordingFolder, open_recording
from emacm.recordings.layout import Layout
from emacm.recordings.meta import read_meta
from emacm.reports.inputs import known_times, value_of

ALARM, FAILED = 1, 3  # exit status


def run(options: argparse.Namespace) -> int:
    """Fit a health index on healthy files, and state the trend of others.

    Returns
    -------
    int
        0; 1 if, with ``--fail-on-alarm``, the latest recording of a unit exceeds its limit; 3 if
        files failed.
    """
    layout = Layout.from_toml(options.layout)
    check_paths([options.healthy, *options.paths])
    healthy = RecordingFolder(options.healthy, layout)
    groups = read_meta(healthy, options.groups, role="--groups")
    units = None if options.unit is None else read_meta(healthy, options.unit, role="--unit")
    steps = order_levels(*extent(healthy, options), options.min_speed)
    model = make_pipeline(*steps, HealthIndex(options.false_alarm))
    model.fit(healthy, healthindex__groups=groups, healthindex__units=units)
    table = _trend(model, options, layout)
    table.to_csv(sys.stdout if options.out is None else options.out, index=False)
    if options.plot is not None:
        _plot(table, options)
    latest = table[table["error"] == ""].groupby("unit", sort=True).tail(1)
    if options.out is not None:
        for row in latest.rename(columns={"index": "value"}).itertuples():
            state = "ALARM" if row.alarm else "within the limit"
            print(f"{row.unit}: {row.value:.2f}, limit {row.limit:.2f}, {state}")
        print(f"Table: {options.out}")
    if options.fail_on_alarm and latest["alarm"].any():
        return ALARM
    return FAILED if (table["error"] != "").any() else 0


def _trend(model: object, options: argparse.Namespace, layout: Layout) -> pd.DataFrame:
    paths = expanded(options.paths)
    recordings = [open_recording(path, layout) for path in paths]
    times = known_times(paths, layout, options.time)
    units = None
    if options.unit is not None:
        units = [value_of(path, layout, options.unit) for path in paths]
    return health_trend(model, recordings, unit=units, time=times)


def _plot(table: pd.DataFrame, options: argparse.Namespace) -> None:
    from emacm.displays.trend import TrendDisplay  # matplotlib is needed only here

    display = TrendDisplay(table, time_label=options.time or "time").plot()
    display.figure_.savefig(options.plot, dpi=150)
