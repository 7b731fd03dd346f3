"""The command ``emacm spectrum``: order spectra, order maps, and orders over speed, of files."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import scipy  # scipy.signal is imported when it is used

from emacm.commands.find import layout_and_files, parts_of_options
from emacm.commands.result_tables import print_json, save_picture, save_table
from emacm.files.folder import open_recording
from emacm.machine.fault_orders import fault_orders
from emacm.orders.columns import parse_order_columns
from emacm.orders.order_psd import OrderPSD
from emacm.orders.order_track import order_track
from emacm.recordings.names import printable, unit_factor
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler

FAILED = 3  # exit status: files without a spectrum


def run(options: argparse.Namespace) -> int:
    """Print the highest lines of each file, or its orders over speed; write table and picture.

    Returns
    -------
    int
        0; 3 if files failed.
    """
    layout, paths = layout_and_files(options)
    if (options.map or (options.order and options.plot)) and len(paths) > 1:
        raise ValueError(
            f"a map, or the picture of --order, is of one file, got {len(paths)}. Name one, or use "
            f"--pattern."
        )
    recordings: dict[str, Recording] = {}
    for path in paths:
        try:
            recording: Recording = open_recording(path, layout)
            if options.channel is not None:
                recording = recording.select([options.channel])
            recording.strokes()  # the file is read here
            recordings[printable(path)] = recording
        except (ImportError, OSError, TypeError, ValueError) as error:
            print(f"emacm: WARNING: {printable(path)}: {error}", file=sys.stderr)
    if not recordings:
        raise ValueError("none of the files can be read.")
    # A coarse grid, so that no warning is about orders that are not drawn.
    resampler = OrderResampler(2 * np.pi / 8, min_speed=options.min_speed)
    quality = resampler.quality([*recordings.values()])
    for name, text in zip(recordings, quality["warnings"], strict=True):
        if text:
            print(f"emacm: WARNING: {name}: {text}", file=sys.stderr)
    highest, revolutions = _extent(options, quality)
    if options.order:
        table = _track(recordings, options.order, revolutions)
    else:
        table = _spectra(recordings, highest, revolutions, options.min_speed)
    if options.csv is not None:
        save_table(table, options.csv)
    if options.json:
        print_json(table)
    else:
        _print(table, quality.set_index(pd.Index(recordings)))
    if options.plot is not None:
        shown = dict(list(recordings.items())[:8])  # as many as can be told apart
        if len(shown) < len(recordings):
            print(f"The picture shows the first 8 of {len(recordings)} files.", file=sys.stderr)
        save_picture(_drawn(shown, table, options, highest, revolutions), options.plot)
    for name, path in (("Table", options.csv), ("Picture", options.plot)):
        if path is not None:
            print(f"{name}: {printable(path)}", file=sys.stderr if options.json else sys.stdout)
    return FAILED if len(recordings) < len(paths) else 0


def _extent(options: argparse.Namespace, quality: pd.DataFrame) -> tuple[float, float]:
    """Return the highest order and the revolutions of a segment, as stated or as files support."""
    supported = float(quality["max_order"].min())
    highest = options.max_order
    if highest is None:
        parts = parts_of_options(options)
        lines = fault_orders(*parts)["order"].max() if parts else 0.0
        highest = min(supported, max(50.0, 4 * float(lines)))
        if highest < supported and not options.order:
            text = f"Orders up to {highest:.4g}; the files support {supported:.4g}: --max-order."
            print(text, file=sys.stderr)
    if highest > supported:
        raise ValueError(
            f"--max-order {highest:g}: the files support orders up to {supported:.4g} at their "
            f"highest speed. Lower it."
        )
    longest = float(quality["longest_stroke"].min())
    usual = (4.0 if longest < 200 else 8.0) if options.map or options.order else 16.0
    return highest, options.revolutions or min(usual, max(1.0, np.floor(longest / 2)))


def _step(highest: float) -> float:
    """Return the angle between samples for which orders are flat up to the highest [rad]."""
    return 2 * np.pi / max(32, 4 * int(np.ceil(highest / 1.5)))


def _spectra(
    recordings: dict[str, Recording], highest: float, revolutions: float, min_speed: float
) -> pd.DataFrame:
    """Return a row for each recording, channel and order."""
    tables = []
    for name, recording in recordings.items():
        resampler = OrderResampler(_step(highest), min_speed=min_speed)
        psd = OrderPSD(revolutions, max_order=highest)
        values = psd.fit_transform(resampler.fit_transform([recording]))
        for block in parse_order_columns([*psd.get_feature_names_out()]) or ():
            density = np.asarray(values)[0, block.columns]
            # A tone has the height A²/2 / 1.5 bins, the equivalent noise bandwidth of a Hann window
            peak = np.sqrt(2 * density * 1.5 * psd.orders_[1])
            unit = recording.units.get(block.channel, "")
            columns: dict[str, Any] = {"order": block.orders, "psd [unit²/order]": density}
            columns |= {"amplitude [peak]": peak, "unit": unit}
            tables.append(pd.DataFrame({"recording": name, "channel": block.channel, **columns}))
    return pd.concat(tables, ignore_index=True)


def _track(
    recordings: dict[str, Recording], orders: list[float], revolutions: float
) -> pd.DataFrame:
    """Return the orders over time and speed, for people: rpm and degrees."""
    tables = []
    for name, recording in recordings.items():
        track = order_track(recording, orders, revolutions=revolutions)
        units = {channel: recording.units.get(channel, "") for channel in recording.channels}
        columns = {
            "recording": name,
            "channel": track["channel"],
            "order": track["order"],
            "time [s]": track["time"],
            "speed [rpm]": track["speed"] / unit_factor("rpm", "velocity"),
            "amplitude [peak]": track["amplitude"],
            "phase [deg]": np.degrees(track["phase"]),
            "unit": track["channel"].map(units),
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def _print(table: pd.DataFrame, quality: pd.DataFrame) -> None:
    """Print where each order is highest, or the five highest lines of each channel."""
    for (name, channel), rows in table.groupby(["recording", "channel"], sort=False):
        print(f"{name}, {channel}:")
        if "speed [rpm]" in rows:
            for order, part in rows.groupby("order", sort=False):
                top = part.loc[part["amplitude [peak]"].idxmax()]
                height = f"{top['amplitude [peak]']:.4g} {top['unit']}".rstrip()
                print(
                    f"    order {order:g}: highest {height} (peak) at "
                    f"{abs(top['speed [rpm]']):.0f} rpm, {top['time [s]']:.4g} s, phase "
                    f"{top['phase [deg]']:.0f} degrees"
                )
            continue
        slow, fast = quality.loc[name, ["slowest", "fastest"]] / (2 * np.pi)
        height = rows["amplitude [peak]"].to_numpy()
        places, _ = scipy.signal.find_peaks(height)
        for place in places[np.argsort(-height[places])][:5]:
            row = rows.iloc[place]
            hertz = f"{row['order'] * slow:.3g} to {row['order'] * fast:.3g} Hz"
            text = f"order {row['order']:.4g} ({hertz}): {row['amplitude [peak]']:.4g}"
            print(f"    {text} {row['unit']}".rstrip(), "(peak)")


def _drawn(
    recordings: dict[str, Recording],
    table: pd.DataFrame,
    options: argparse.Namespace,
    highest: float,
    revolutions: float,
) -> Any:
    """Return the figure of the first channel: over orders and, with --hz, over frequency below."""
    from emacm.displays import OrderMapDisplay, OrderSpectrumDisplay, OrderTrackDisplay
    from emacm.displays.drawing import offscreen_panels
    from emacm.displays.recording import draw_map_in_hertz, draw_spectra_in_hertz

    first = next(iter(recordings.values()))
    channel, parts = first.channels[0], parts_of_options(options)
    unit, over = first.units.get(channel, "unit"), "time" if options.over == "time" else "speed"
    marks: dict[str, Any] = {"fault_orders": fault_orders(*parts)} if parts else {}
    if options.order:
        known: dict[str, Any] = {"over": over, "revolutions": revolutions}
        figure = OrderTrackDisplay.from_recording(first, options.order, channel, **known).figure_
    elif options.map:
        figure, panels = offscreen_panels(2 if options.hz else 1, height=7.2 if options.hz else 4)
        known = {"revolutions": revolutions, "max_order": highest, "theta_s": _step(highest)}
        known |= {"over": over, "ax": panels[0, 0]} | marks
        display = OrderMapDisplay.from_recording(first, channel, **known)
        if options.hz:
            draw_map_in_hertz(first, display, highest, panels[1, 0])
    else:
        figure, panels = offscreen_panels(2 if options.hz else 1, height=6.4 if options.hz else 4)
        table = table[(table["channel"] == channel) & table["recording"].isin([*recordings])]
        lines = dict(iter(table.groupby("recording", sort=False)))
        values = {name: rows["psd [unit²/order]"].to_numpy() for name, rows in lines.items()}
        orders = next(iter(lines.values()))["order"].to_numpy()
        lined: dict[str, Any] = {"channel": channel, "unit": unit, "max_order": highest}
        OrderSpectrumDisplay(orders, values, **lined, **marks).plot(ax=panels[0, 0])
        if options.hz:
            draw_spectra_in_hertz(recordings, channel, highest, panels[1, 0])
    if options.map or options.order:
        figure.suptitle(Path(next(iter(recordings))).name, fontsize=8)
    return figure
