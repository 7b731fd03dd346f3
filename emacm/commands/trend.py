"""The command ``emacm trend``: health index of each unit over time."""

from __future__ import annotations

import argparse
import re
import sys
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import pandas as pd
from sklearn.base import clone
from sklearn.pipeline import FeatureUnion, make_pipeline

from emacm.alarms.health_index import HealthIndex, health_trend
from emacm.calibration.left_out import groups_needed
from emacm.commands.find import layout_and_files, parts_of_options
from emacm.commands.result_tables import print_json, save_picture, save_table
from emacm.commands.train import extent
from emacm.envelopes.envelope_detector import EnvelopeDetector
from emacm.files.folder import RecordingFolder, open_recording
from emacm.files.layout import Layout
from emacm.machine.bearing_recipe import bearing_recipe
from emacm.machine.rolling import BallScrew, Bearing
from emacm.machine.severity_zones import severity_zone, vibration_indicators
from emacm.models.recipes import order_levels
from emacm.recordings.meta import read_meta
from emacm.recordings.names import printable
from emacm.reports.inputs import as_cell, units_and_times

ALARM, FAILED = 1, 3  # exit status


def run(options: argparse.Namespace) -> int:
    """Fit a health index on healthy files, and state the trend of others.

    Returns
    -------
    int
        0; 1 if, with ``--fail-on-alarm``, the latest recording of a unit exceeds its limit, or any
        of it where times are not known; 3 if files failed.
    """
    table, n_groups, remarks, judged = _trend_of_files(options)
    has_times = judged != "highest"
    rows = table if has_times else table.assign(time="")
    if options.out is not None:
        save_table(rows, options.out)
    if options.json:
        print_json(rows)
    elif options.out is None:
        rows.map(as_cell).to_csv(sys.stdout, index=False)
    whole = table[table["error"] == ""]
    latest = whole.sort_values(["unit", "time" if has_times else "index"]).groupby("unit").tail(1)
    if options.plot is not None:
        from emacm.displays.monitoring import TrendDisplay  # matplotlib is needed only here

        shown = _most_urgent(table, latest)
        label = options.time or "time" if has_times else "number of the file (times not known)"
        save_picture(TrendDisplay(shown, time_label=label).plot().figure_, options.plot)
    meanings = [*_meanings(latest, n_groups), *remarks]
    is_data = options.out is None or options.json
    print(*meanings, sep="\n", file=sys.stderr if is_data else sys.stdout)
    if not is_data:
        for row in latest.rename(columns={"index": "value"}).itertuples():
            state = "ALARM" if row.alarm else "within the limit"
            print(f"{row.unit}: {judged} {row.value:.2f}, limit {row.limit:.2f}, {state}")
        print(f"Table: {printable(options.out)}")
    if options.fail_on_alarm and latest["alarm"].any():
        return ALARM
    return FAILED if (table["error"] != "").any() else 0


def _most_urgent(table: pd.DataFrame, latest: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of the 8 units whose latest index is highest, as many as a picture shows."""
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


def _trend_of_files(
    options: argparse.Namespace,
) -> tuple[pd.DataFrame, dict[str, int], list[str], str]:
    """Return the trend of files, the groups of each limit, remarks, and what is judged of a unit.

    This is the "latest" recording, the "latest written", or the "highest" where times are not
    known: those of the table are then the numbers of the files.
    """
    if options.machine is not None:
        severity_zone(0.0, options.machine)  # an unknown class is refused before files are read
    layout, paths = layout_and_files(options)
    healthy = RecordingFolder(options.healthy, layout, options.pattern)
    groups, alone = [*range(len(healthy))], ""
    if options.groups is not None:
        groups = read_meta(healthy, options.groups, role="--groups")
    else:
        alone = "Each healthy file counts as a run. If they are parts of runs, give --groups FIELD."
    units = None if options.unit is None else read_meta(healthy, options.unit, role="--unit")
    new_units, times = units_and_times(paths, layout, options.unit, options.time)
    doubt, judged = "", "latest"
    if options.time is None:
        doubt, judged = _doubt(paths, layout, new_units or [""] * len(paths), times)
        times = [*range(len(paths))] if judged == "highest" else times
    max_order, revolutions, _ = extent(healthy, options)
    speed, parts = options.min_speed, parts_of_options(options)
    rolling = [part for part in parts if isinstance(part, (Bearing, BallScrew))]
    given = {k: order for part in parts if isinstance(part, dict) for k, order in part.items()}
    impacts = {name: order for name, order in given.items() if order not in (1, 2)}  # of a shaft
    struck = [*rolling, impacts] if impacts else rolling
    spectra: list[tuple[str, Any]] = []
    if struck:  # lines of the envelope
        lines = bearing_recipe(struck, revolutions=revolutions, min_speed=speed)
        spectra.append(("lines", lines))
    if len(rolling) < len(parts) or not parts:  # gears and shafts, in bins of all orders
        levels = order_levels(max_order, revolutions, speed)
        envelope = make_pipeline(EnvelopeDetector("full", squared=False), *map(clone, levels))
        spectra += [("signal", make_pipeline(*levels)), ("envelope", envelope)]
    index = HealthIndex(options.false_alarm, few_groups="log-normal")
    model = make_pipeline(FeatureUnion(spectra), index)
    model.fit(healthy, healthindex__groups=groups, healthindex__units=units)
    recordings = [open_recording(path, layout) for path in paths]
    table = health_trend(model, recordings, unit=new_units, time=times)
    rows: list[dict[str, Any]] = [{} for _ in range(len(table))]
    names = lines.get_feature_names_out() if struck else []
    for own, row in zip(rows, table.itertuples(), strict=True):
        if not row.error:
            recording = open_recording(row.recording, layout)
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                own |= vibration_indicators(recording, options.machine, min_speed=speed)
            if caught:
                own["remarks"] = "; ".join(str(item.message) for item in caught)
            if struck:
                found = zip(names, lines.transform([recording])[0], strict=True)
                own |= {f"{name} [dB]": level for name, level in found}
    table = table.join(pd.DataFrame(rows, index=table.index))
    remarks = [alone, doubt, _of_zones(table, options.machine)]
    n_groups = index.left_out_.groupby("baseline")["group"].nunique().to_dict()
    return table, n_groups, [text for text in remarks if text], judged


def _of_zones(table: pd.DataFrame, machine: str | None) -> str:
    """Say what is to be known about velocities and zones, or ""."""
    if "remarks" in table:
        noted = table[table["remarks"].notna()]
        first = f"{noted['recording'].iloc[0]}: {noted['remarks'].iloc[0]}"
        return f"WARNING: {len(noted)} of {len(table)} recordings have remarks. {first}"
    if machine and not any(name.endswith(":zone") for name in table):
        return "WARNING: --machine needs a channel in g, m/s2 or mm/s2."
    return ""


def _doubt(
    paths: Sequence[Path], layout: Layout, units: Sequence[Any], times: Sequence[pd.Timestamp]
) -> tuple[str, str]:
    """Say which times are those at which files were written, and which recordings are judged."""
    files = pd.DataFrame({"path": paths, "unit": units, "time": times})
    written = [pd.Timestamp(path.stat().st_mtime, unit="s") for path in paths]
    files = files[files["time"] == written].sort_values("time", kind="stable")
    remedy = "name a field of the layout's meta by --time."
    for _, own in files.groupby("unit"):
        if reason := _contradiction(own["path"].tolist(), own["time"].tolist(), layout):
            text = "Times are not known: the files state none, and they were not written in turn"
            text = f"{text}: {reason}. The highest index of each unit is judged: {remedy}"
            return text, "highest"
    if files.empty:
        return "", "latest"
    text = f"{len(files)} of {len(paths)} files state no time: that at which they were written is"
    return f"{text} taken. If they were copied since, {remedy}", "latest written"


def _contradiction(paths: list[Path], times: list[pd.Timestamp], layout: Layout) -> str:
    """Return why the recordings of a unit were not made when their files were written, or ""."""
    for k, (before, path) in enumerate(pairwise(paths), 1):
        gap = (times[k] - times[k - 1]).total_seconds()
        with suppress(ImportError, OSError, TypeError, ValueError):  # its row states why
            duration = open_recording(path, layout).duration
            if gap < duration / 2:
                name = f"{printable(path)}, {duration:.3g} s long,"
                return f"{name} follows {printable(before)} after {gap:.3g} s"
    numbers = [[int(number) for number in re.findall(r"\d+", str(path))] for path in paths]
    fields = [field for field in zip(*numbers, strict=False) if len(set(field)) > 1]
    # One of the numbers may be that of the run, beside a speed or a load.
    if fields and not any(list(field) == sorted(field) for field in [*fields, numbers]):
        k = next(k for k in range(1, len(paths)) if numbers[k] < numbers[k - 1])
        return f"{printable(paths[k])} follows {printable(paths[k - 1])}"
    return ""
