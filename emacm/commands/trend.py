"""The command ``emacm trend``: health index of each unit over time."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from contextlib import nullcontext
from typing import Any

import pandas as pd
from sklearn.base import clone
from sklearn.pipeline import FeatureUnion, make_pipeline

from emacm._saved import written_whole
from emacm.alarms.health_index import HealthIndex, health_trend
from emacm.calibration.left_out import groups_needed
from emacm.commands.find import parts_of_options
from emacm.commands.train import extent, order_levels
from emacm.envelopes.envelope_detector import EnvelopeDetector
from emacm.files.folder import RecordingFolder, open_recording, recording_files
from emacm.files.layout import Layout
from emacm.machine.bearing_recipe import bearing_recipe
from emacm.machine.severity_zones import severity_zone, vibration_indicators
from emacm.recordings.meta import read_meta
from emacm.recordings.names import printable
from emacm.reports.inputs import as_cell, units_and_times

ALARM, FAILED = 1, 3  # exit status


def run(options: argparse.Namespace) -> int:
    """Fit a health index on healthy files, and state the trend of others.

    Returns
    -------
    int
        0; 1 if, with ``--fail-on-alarm``, the latest recording of a unit exceeds its limit; 3 if
        files failed.
    """
    table, n_groups = _trend_of_files(options)
    with nullcontext(sys.stdout) if options.out is None else written_whole(options.out) as out:
        table.map(as_cell).to_csv(out, index=False)
    if options.plot is not None:
        from emacm.displays.monitoring import TrendDisplay  # matplotlib is needed only here

        shown = _most_urgent(table)
        display = TrendDisplay(shown, time_label=options.time or "time").plot()
        with written_whole(options.plot) as unfinished:
            display.figure_.savefig(unfinished, dpi=150, format=options.plot.suffix[1:] or "png")
    if options.machine and not any(name.endswith(":zone") for name in table.columns):
        print("emacm: WARNING: --machine needs a channel in g, m/s2 or mm/s2.", file=sys.stderr)
    latest = table[table["error"] == ""].groupby("unit", sort=True).tail(1)
    meanings = _meanings(latest, n_groups)
    print(*meanings, sep="\n", file=sys.stderr if options.out is None else sys.stdout)
    if options.out is not None:
        for row in latest.rename(columns={"index": "value"}).itertuples():
            state = "ALARM" if row.alarm else "within the limit"
            print(f"{row.unit}: {row.value:.2f}, limit {row.limit:.2f}, {state}")
        print(f"Table: {printable(options.out)}")
    if options.fail_on_alarm and latest["alarm"].any():
        return ALARM
    return FAILED if (table["error"] != "").any() else 0


def _most_urgent(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of the 8 units whose latest index is highest, as many as a picture shows."""
    latest = table[table["index"].notna()].groupby("unit").tail(1)
    units = (latest["index"] / latest["limit"]).set_axis(latest["unit"]).nlargest(8).index
    if len(units) < len(latest):
        print("The picture shows the 8 units with the highest latest index.", file=sys.stderr)
    return table[table["unit"].isin(units)]


def _meanings(latest: pd.DataFrame, n_groups: Mapping[str, int]) -> list[str]:
    """Say what the limits mean: of each baseline, how often a healthy recording exceeds them."""
    sentences = []
    for (baseline, limit, rate), _ in latest.groupby(["baseline", "limit", "false_alarm"]):
        text = f"Limit {limit:.2f} ({baseline}): {rate:.1%} of healthy recordings exceed it"
        needed = groups_needed(1 - rate)
        if n_groups[baseline] < needed:
            text += (
                f", if the logarithm of the index is normal: {n_groups[baseline]} healthy groups "
                f"cannot show this rate, {needed} are needed"
            )
        sentences.append(f"{text}.")
    return sentences


def _trend_of_files(options: argparse.Namespace) -> tuple[pd.DataFrame, dict[str, int]]:
    """Return the distances of files from healthy ones, and how many groups each limit is from."""
    layout = Layout.from_toml(options.layout)
    if options.machine is not None:
        severity_zone(0.0, options.machine)  # an unknown class is refused before files are read
    paths = recording_files(options.paths, layout, options.pattern)
    healthy = RecordingFolder(options.healthy, layout, options.pattern)
    groups = read_meta(healthy, options.groups, role="--groups")
    units = None if options.unit is None else read_meta(healthy, options.unit, role="--unit")
    new_units, times = units_and_times(paths, layout, options.unit, options.time)
    max_order, revolutions, _ = extent(healthy, options)
    speed, parts = options.min_speed, parts_of_options(options)
    if parts:
        recipe = bearing_recipe(parts, revolutions=revolutions, min_speed=speed)
        steps = [step for _, step in recipe.steps]
    else:
        levels = order_levels(max_order, revolutions, speed)
        envelope = make_pipeline(EnvelopeDetector("full", squared=False), *map(clone, levels))
        steps = [FeatureUnion([("signal", make_pipeline(*levels)), ("envelope", envelope)])]
    index = HealthIndex(options.false_alarm, few_groups="log-normal")
    model = make_pipeline(*steps, index)
    model.fit(healthy, healthindex__groups=groups, healthindex__units=units)
    recordings = [open_recording(path, layout) for path in paths]
    table = health_trend(model, recordings, unit=new_units, time=times)
    rows: list[dict[str, Any]] = [{} for _ in range(len(table))]
    names = [f"{name} [dB]" for name in model[:-1].get_feature_names_out()]
    for own, row in zip(rows, table.itertuples(), strict=True):
        if not row.error:
            recording = open_recording(row.recording, layout)
            own |= vibration_indicators(recording, options.machine, min_speed=speed)
            if parts:
                own |= dict(zip(names, model[:-1].transform([recording])[0], strict=True))
    n_groups = index.left_out_.groupby("baseline")["group"].nunique().to_dict()
    return table.join(pd.DataFrame(rows, index=table.index)), n_groups
