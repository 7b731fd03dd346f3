"""The command ``emacm find``: faults of bearings and gears named from the geometry of a machine."""

from __future__ import annotations

import argparse
import sys
import textwrap
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sklearn.pipeline import make_pipeline

from emacm.commands.result_tables import print_json, save_table
from emacm.files.drafts import contents_of, draft_layout
from emacm.files.folder import RecordingFolder, open_recording, recording_files
from emacm.files.layout import Layout
from emacm.machine.fault_orders import fault_orders
from emacm.machine.fault_spectra import healthy_scores, longest_stroke
from emacm.machine.find_faults import find_faults
from emacm.machine.rolling import bearing_of, designation_in, published_bearings
from emacm.models.recipes import order_levels
from emacm.recordings.names import printable
from emacm.recordings.recording import Recording
from emacm.reports.inputs import read_parts
from emacm.reports.maintenance import file_stems

FOUND, FAILED = 1, 3  # exit status: a fault is named; files without an answer


def run(options: argparse.Namespace) -> int:
    """Print what is found in each file and channel, and return the exit status.

    Returns
    -------
    int
        0; 1 if a fault is named; 3 if there is no answer for some of the files.
    """
    parts = parts_of_options(options)
    if options.bearing and (name := designation_in(options.bearing)):
        source = published_bearings().at[name, "source"]
        print(f"emacm: geometry of {name}: {source}. Other makers may differ.", file=sys.stderr)
    layout, paths = layout_and_files(options)
    healthy = None
    if options.healthy is not None:
        folder = RecordingFolder(options.healthy, layout, options.pattern)
        healthy = healthy_scores(folder, parts)
    rows: list[dict[str, Any]] = []
    n_drawn = 0
    to = sys.stderr if options.json else sys.stdout
    for path in paths:
        for row in _rows(path, layout, parts, healthy):
            rows.append(row)
            suspected = f" (suspected: {row['suspected']})" if row["suspected"] != "none" else ""
            place = ", ".join(filter(None, (row["recording"], row["channel"])))
            print(f"{place}: {row['named']}{suspected}\n    {row['explanation']}", file=to)
            is_found = {row["named"], row["suspected"]} - {"none", "failed", "not assessed"}
            if options.plot is not None and is_found:
                _draw(row, open_recording(path, layout), parts, options.plot, len(rows))
                n_drawn += 1
    table = pd.DataFrame(rows)
    if options.out is not None:
        save_table(table, options.out)
        print(f"Table: {printable(options.out)}", file=to)
    if options.plot is not None:
        print(f"Pictures: {n_drawn} in {printable(options.plot)}", file=to)
    if options.json:
        print_json(table)
    is_missing = table["named"].isin(["not assessed", "failed"])
    if (~is_missing & (table["named"] != "none")).any():
        return FOUND
    return FAILED if is_missing.any() else 0


def parts_of_options(options: argparse.Namespace) -> list[Any]:
    """Return the parts of the machine that --bearing and --parts state."""
    parts = [bearing_of(options.bearing)] if options.bearing else []
    return parts + (read_parts(options.parts) if options.parts else [])


def layout_and_files(options: argparse.Namespace) -> tuple[Layout, list[Path]]:
    """Return the layout of --layout, or that of a draft which leaves nothing open, and the files.

    Raises
    ------
    ValueError
        If a file does not state what is needed; the message lists it.
    """
    if options.layout is not None:
        layout = Layout.from_toml(options.layout)
    else:
        first = recording_files(options.paths, None, options.pattern)[0]
        layout = _drafted(first, needs_shaft=options.speed is None)
    if options.speed is not None:
        speed = f"{options.speed:g} rpm"
        if stated := layout.velocity or layout.angle or layout.tacho:
            text = f"--speed {speed} is used, {stated!r} of the files is not."
            print(f"emacm: WARNING: {text}", file=sys.stderr)
        layout = replace(layout, angle=None, tacho=None, velocity=speed)
    return layout, recording_files(options.paths, layout, options.pattern)


def _drafted(path: Path, *, needs_shaft: bool) -> Layout:
    """Return the layout of a draft, which the file must state in full."""
    contents = contents_of(path)
    if not contents.channels:
        unused = "".join(f" {name!r} is not used: {why}." for name, why in contents.unused.items())
        raise ValueError(
            f"{printable(path)} has no channel.{unused} If it holds the speed of other files, "
            f"select those by --pattern, and name it in a layout: velocity = {{file = ..., "
            f"column = ...}}."
        )
    remarks = [*contents.remarks]
    if needs_shaft and contents.of_shaft:
        remarks.append(contents.of_shaft)
    if remarks:
        raise ValueError(
            f"{printable(path)} does not state everything: {'; '.join(remarks)}. Give --speed, or "
            f"write a layout by emacm inspect {printable(path)} --draft layout.toml."
        )
    return Layout(**tomllib.loads(draft_layout(contents, path)))


def _rows(path: Path, layout: Layout, parts: list[Any], healthy: Any) -> list[dict[str, Any]]:
    """Return the rows of the channels of a file, or one that states why there is none."""
    name = printable(path)
    try:
        found = find_faults([open_recording(path, layout)], parts, healthy=healthy)
    except (ImportError, OSError, TypeError, ValueError) as error:
        text = {"channel": "", "named": "failed", "suspected": "none", "explanation": str(error)}
        return [{"recording": name} | text]
    return found.assign(recording=name).to_dict("records")


def _draw(
    row: dict[str, Any], recording: Recording, parts: list[Any], folder: Path, number: int
) -> None:
    """Draw the spectra of a channel in which a fault is named or suspected.

    Shafts and gears are judged in the order spectrum, bearings in that of the envelope.
    """
    from emacm.displays import FaultLinesDisplay, OrderSpectrumDisplay
    from emacm.displays.drawing import offscreen_panels

    folder.mkdir(parents=True, exist_ok=True)
    figure, (above, below) = offscreen_panels(2, height=7.5)
    channel, lines = row["channel"], fault_orders(*parts)
    FaultLinesDisplay.from_recording(recording, parts, channel=channel, ax=below)
    known = 0.4 * recording.fs[channel] * 2 * np.pi / np.abs(recording.velocity).max()
    top = min(known, max(1.2 * lines["order"].max(), below[0].get_xlim()[1]))
    length = min(64, int(longest_stroke(recording)))
    spectrum = make_pipeline(*order_levels(top, length, 0.0)[:2]).fit([recording])
    marks: dict[str, Any] = {"fault_orders": lines[lines["order"] > 0.1], "max_order": top}
    OrderSpectrumDisplay.from_estimator(spectrum, [recording], channel, ax=above, **marks)
    text = f"{row['recording']}: {row['named']}. {row['explanation']}"
    text += ". Below: the spectrum of the prewhitened envelope."
    figure.suptitle(textwrap.fill(text, 100), fontsize=8)
    name = f"{Path(row['recording']).stem}_{channel.replace('/', '_')}_{number:03d}.png"
    (stem,) = file_stems([name])
    figure.savefig(folder / f"{stem}.png")
