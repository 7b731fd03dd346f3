"""The command ``emacm inspect``: what a file contains, a plot of it, and a draft of its layout."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from emacm._checks import located
from emacm.recordings.column_names import is_shaft_name, is_time_name
from emacm.recordings.file_columns import FileColumns, stated_rates
from emacm.recordings.readers import read_columns
from emacm.recordings.sample_times import rate_of_times, seconds_of
from emacm.recordings.units import unit_factor

_MOST_PANELS = 12


@dataclass
class Contents:
    """What was found in a file.

    Attributes
    ----------
    columns : FileColumns
        Its columns.
    rates : dict of str to float
        Sampling rates that the file states, or its column of times [Hz].
    times, shaft : str or None
        Columns that are named like times and like the motion of the shaft.
    remarks : list of str
        What must be stated in a layout.
    """

    columns: FileColumns
    rates: dict[str, float]
    times: str | None
    shaft: str | None
    remarks: list[str]


def run(options: argparse.Namespace) -> int:
    """Print what a file contains; draw it and write a draft of its layout if asked to.

    Returns
    -------
    int
        0.
    """
    with located(str(options.file)):
        contents = contents_of(options.file)
    with pd.option_context("display.width", 200, "display.max_columns", None):
        print(contents_table(contents).to_string())
    for name, number in contents.columns.numbers.items():
        print(f"{name} = {number:.9g} {contents.columns.units.get(name, '')}".rstrip())
    for remark in contents.remarks:
        print(f"To be stated in the layout: {remark}")
    if options.draft is not None:
        if options.draft.exists():
            raise ValueError(f"{str(options.draft)!r} exists. Choose another name for --draft.")
        options.draft.write_text(draft_layout(contents, options.file), encoding="utf-8")
        print(f"Draft of the layout: {options.draft}")
    if options.plot is not None:
        plot(contents, options.plot)
        print(f"Plot: {options.plot}")
    return 0


def contents_of(path: Path) -> Contents:
    """Read a file, and find out which of its columns are times and shaft.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Contents

    Raises
    ------
    FileNotFoundError, ImportError, ValueError
        As `emacm.recordings.readers.read_columns`.
    """
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {str(path)!r}.")
    columns = read_columns(path)
    rates, remarks = stated_rates(columns), []
    named = [name for name in columns.columns if is_time_name(name)]
    times = named[0] if named else None
    if times is not None:
        try:
            values = columns.columns[times]
            rate = rate_of_times(seconds_of(values, columns.units.get(times, ""), times), times)
            same = [name for name, other in columns.columns.items() if len(other) == len(values)]
            rates |= {name: rate for name in same if name not in rates}
        except ValueError as error:
            remarks.append(str(error))
    shaft = next(_named_like_a_shaft(columns), None)
    if shaft is None:
        remarks.append("velocity, angle or tacho: no column is named like the motion of the shaft")
    elif not _unit_known(columns, shaft):
        remarks.append(f"the unit of {shaft!r}")
    if any(name not in rates for name in columns.columns if name != times):
        remarks.append("fs: neither the file nor a column of times states the sampling rate")
    return Contents(columns, rates, times, shaft, remarks)


def _named_like_a_shaft(columns: FileColumns) -> Iterator[str]:
    return (name for name in (*columns.columns, *columns.numbers) if is_shaft_name(name))


def _kind(name: str) -> str:
    words = name.lower()
    if "tach" in words or "keyphasor" in words:
        return "tacho"
    return "angle" if "angle" in words or "theta" in words or "encoder" in words else "velocity"


def _unit_known(columns: FileColumns, shaft: str) -> bool:
    if _kind(shaft) == "tacho":
        return True
    try:
        unit_factor(columns.units.get(shaft, ""), _kind(shaft))
    except ValueError:
        return False
    return True


def contents_table(contents: Contents) -> pd.DataFrame:
    """Return a row for each column: unit, rate, samples, duration and range.

    Parameters
    ----------
    contents : Contents
        What was found.

    Returns
    -------
    DataFrame
        Columns "as" (time, shaft or channel), "unit", "rate [Hz]", "samples", "duration [s]",
        "lowest", "mean", "highest" and "not finite" (number of samples).
    """
    rows = {}
    for name, values in contents.columns.columns.items():
        rate = contents.rates.get(name, np.nan)
        role = {contents.times: "time", contents.shaft: "shaft"}.get(name, "channel")
        row: dict[str, Any] = {
            "as": role,
            "unit": contents.columns.units.get(name, ""),
            "rate [Hz]": rate,
            "samples": len(values),
            "duration [s]": len(values) / rate,
        }
        if values.dtype.kind in "biuf":
            good = values[np.isfinite(values)]
            if len(good):
                row |= {"lowest": good.min(), "mean": good.mean(), "highest": good.max()}
            row["not finite"] = len(values) - len(good)
        rows[name] = row
    return pd.DataFrame.from_dict(rows, orient="index")


def draft_layout(contents: Contents, path: Path) -> str:
    """Return a layout as TOML; what the file does not state is a comment to be filled in.

    Parameters
    ----------
    contents : Contents
        What was found in the file.
    path : Path
        The file.

    Returns
    -------
    str
    """
    columns, text = contents.columns, json.dumps
    channels = [
        name
        for name, values in columns.columns.items()
        if name not in (contents.times, contents.shaft) and values.dtype.kind in "biuf"
    ]
    lines = [f"# Layout of files like {path.name}; see emacm.Layout for all options."]
    if contents.times is not None:
        lines.append(f"time = {text(contents.times)}")
    elif any(name not in contents.rates for name in columns.columns):
        lines.append("# fs = 12000  # Hz: neither the file nor a column of times states it")
    lines.append(f"channels = {text(channels, ensure_ascii=False)}")
    if contents.shaft is None:
        lines.append('# velocity = "1797 rpm"  # a constant speed, or the name of a column')
    else:
        lines.append(f"{_kind(contents.shaft)} = {text(contents.shaft)}")
    fields = "_".join(f"{{field{n}}}" for n in range(1, path.stem.count("_") + 2))
    lines.append(f"# meta = {text(fields)}  # what the parts of the names of the files mean")
    known = {name: columns.units[name] for name in channels if columns.units.get(name)}
    shaft = contents.shaft
    if shaft is not None and _unit_known(columns, shaft) and columns.units.get(shaft):
        known[shaft] = columns.units[shaft]
    lines += ["", "[units]"]
    lines += [f"{text(name)} = {text(unit, ensure_ascii=False)}" for name, unit in known.items()]
    if shaft is not None and not _unit_known(columns, shaft):
        usual = "rpm" if _kind(shaft) == "velocity" else "rad"
        lines.append(f"# {text(shaft)} = {text(usual)}  # the file does not state its unit")
    return "\n".join(lines) + "\n"


def plot(contents: Contents, path: Path) -> None:
    """Draw the columns over time, or over the number of the sample, into a picture.

    Parameters
    ----------
    contents : Contents
        What was found in a file; at most 12 columns are drawn.
    path : Path
        The picture.

    Raises
    ------
    ImportError
        If matplotlib is not installed.
    """
    from emacm.displays import _drawing
    from emacm.displays.recording import extremes

    drawn = [
        (name, values)
        for name, values in contents.columns.columns.items()
        if name != contents.times and values.dtype.kind in "biuf"
    ][:_MOST_PANELS]
    axes = _drawing.panel_axes(None, len(drawn), height=1.3)
    timed = all(name in contents.rates for name, _ in drawn)
    for panel, (name, values) in zip(axes, drawn, strict=True):
        rate = contents.rates[name] if timed else 1.0
        numbers, shown = extremes(np.arange(len(values)) / rate, values)
        panel.plot(numbers, shown, color=_drawing.PLAIN, linewidth=0.8)
        panel.set_xlim(0, max(len(values) - 1, 1) / rate)
        _drawing.label_y(panel, name, contents.columns.units.get(name, "unit"))
    _drawing.label_x(axes, "time [s]" if timed else "sample")
    axes[0].figure.savefig(path, dpi=150)
