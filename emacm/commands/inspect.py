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
from numpy.typing import NDArray

from emacm._checks import located
from emacm._saved import written_whole
from emacm.files.file_columns import FileColumns, rates_of_columns, stated_rates
from emacm.files.layout import Layout
from emacm.files.readers import read_columns
from emacm.recordings.names import is_time_name, printable, unit_factor, unit_in_name

_ANGLES = ("angle", "theta", "encoder", "winkel")


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
    shaft_unit : str
        Unit of the shaft column, from the file or from its name; "" if it is not known.
    unused : dict of str to str
        Columns that are neither times, shaft nor channels, and why.
    remarks : list of str
        What must be stated in a layout.
    """

    columns: FileColumns
    rates: dict[str, float]
    times: str | None
    shaft: str | None
    shaft_unit: str
    unused: dict[str, str]
    remarks: list[str]

    @property
    def channels(self) -> list[str]:
        """The other columns."""
        others = {self.times, self.shaft, *self.unused}
        return [name for name in self.columns.columns if name not in others]

    @property
    def has_rates(self) -> bool:
        """Whether the rates of all channels are known."""
        return self.rates.keys() >= set(self.channels)

    @property
    def numbers(self) -> dict[str, NDArray[Any]]:
        """The columns of numbers."""
        columns = self.columns.columns
        return {name: values for name, values in columns.items() if values.dtype.kind in "biuf"}


def run(options: argparse.Namespace) -> int:
    """Print what a file contains; draw it and write a draft of its layout if asked to.

    Returns
    -------
    int
        0.
    """
    with located(printable(options.file)):
        contents = contents_of(options.file)
    with pd.option_context("display.width", 200, "display.max_columns", None):
        print(contents_table(contents).to_string())
    for name, number in contents.columns.numbers.items():
        print(f"{name} = {number:.9g} {contents.columns.units.get(name, '')}".rstrip())
    for name, reason in contents.unused.items():
        print(f"Not used: {name!r}, {reason}")
    for remark in contents.remarks:
        print(f"To be stated in the layout: {remark}")
    if options.draft is not None:
        if options.draft.exists():
            raise ValueError(f"{str(options.draft)!r} exists. Choose another name for --draft.")
        with written_whole(options.draft) as unfinished:
            unfinished.write_text(draft_layout(contents, options.file), encoding="utf-8")
        print(f"Draft of the layout: {printable(options.draft)}")
    if options.plot is not None:
        plot(contents, options.plot)
        print(f"Plot: {printable(options.plot)}")
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
        As `emacm.files.readers.read_columns`.
    """
    columns = read_columns(path)
    times = next(filter(is_time_name, columns.columns), None)
    remarks: list[str] = []
    try:
        rates = rates_of_columns(columns, Layout(), times)
    except ValueError as error:
        rates, remarks = stated_rates(columns), [str(error)]
    shafts = columns.like_shaft()
    shaft = shafts[0] if shafts else None
    unit = _shaft_unit(columns, shaft) if shaft else ""
    if shaft is None:
        remarks.append("velocity, angle or tacho: no column is named like the motion of the shaft")
    elif not unit and _kind(shaft) != "tacho":
        remarks.append(f"the unit of {shaft!r}")
    found = Contents(columns, rates, times, shaft, unit, {}, remarks)
    texts = [name for name in columns.columns if name not in found.numbers and name != times]
    found.unused |= dict.fromkeys(texts, "it does not consist of numbers")
    found.unused |= dict.fromkeys(shafts[1:], "it is named like the motion of a shaft")
    if not found.has_rates:
        remarks.append("fs: neither the file nor a column of times states the sampling rate")
    return found


def _kind(name: str) -> str:
    words = name.lower()
    if "tach" in words or "keyphasor" in words:
        return "tacho"
    return "angle" if any(word in words for word in _ANGLES) else "velocity"


def _shaft_unit(columns: FileColumns, shaft: str) -> str:
    """Return the unit of a speed or an angle; "" if it is not stated, or is another one."""
    for unit in (columns.units.get(shaft, ""), unit_in_name(shaft)):
        try:
            unit_factor(unit, _kind(shaft))
        except (KeyError, ValueError):
            continue
        return unit
    return ""


def contents_table(contents: Contents) -> pd.DataFrame:
    """Return a row for each column: unit, rate, samples, duration and range.

    Parameters
    ----------
    contents : Contents
        What was found.

    Returns
    -------
    DataFrame
        Columns "as" (time, shaft, channel or not used), "unit", "rate [Hz]", "samples",
        "duration [s]", "lowest", "mean", "highest" and "not finite" (number of samples).
    """
    rows = {}
    roles = {contents.times: "time", contents.shaft: "shaft"}
    roles |= dict.fromkeys(contents.unused, "not used")
    for name, values in contents.columns.columns.items():
        rate = contents.rates.get(name, np.nan)
        rows[name] = {
            "as": roles.get(name, "channel"),
            "unit": contents.columns.units.get(name, ""),
            "rate [Hz]": rate,
            "samples": len(values),
            "duration [s]": len(values) / rate,
        }
        if name in contents.numbers:
            good = pd.Series(values[np.isfinite(values)])
            rows[name] |= {"lowest": good.min(), "mean": good.mean(), "highest": good.max()}
            rows[name]["not finite"] = len(values) - len(good)
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
    lines = [
        f"# Layout of files like {printable(path.name)}; see emacm.Layout for all options.",
        '# "FILL IN": the file does not state it. Correct the line, and remove its first #.',
    ]
    if contents.times is not None:
        lines.append(f"# time: the column {_text(contents.times)}, found by its name")
    if not contents.has_rates:
        lines.append("# fs = 12000  # FILL IN: sampling rate [Hz]")
    else:
        rates = sorted({contents.rates[name] for name in contents.channels})
        lines.append(f"# fs: {', '.join(f'{rate:.9g}' for rate in rates)} Hz, found in the file")
    lines.append(f"channels = [{', '.join(map(_text, contents.channels))}]")
    lines += [f"# {_text(name)} is not used: {why}" for name, why in contents.unused.items()]
    if contents.shaft is None:
        lines.append('# velocity = "1797 rpm"  # FILL IN: a constant speed, or a column')
    else:
        lines.append(f"{_kind(contents.shaft)} = {_text(contents.shaft)}")
    fields = "_".join(f"{{field{n}}}" for n in range(1, path.stem.count("_") + 2))
    lines.append(f"# meta = {_text(fields)}  # FILL IN: what the parts of the file names mean")
    return "\n".join([*lines, "", "[units]", *_units(contents)]) + "\n"


def _units(contents: Contents) -> Iterator[str]:
    """Yield the lines of a draft with the units of shaft and channels."""
    stated, shaft = contents.columns.units, contents.shaft
    if shaft is not None and contents.shaft_unit:
        source = "" if stated.get(shaft) == contents.shaft_unit else "  # from its name"
        yield f"{_text(shaft)} = {_text(contents.shaft_unit)}{source}"
    elif shaft is not None and _kind(shaft) != "tacho":
        usual = "rpm" if _kind(shaft) == "velocity" else "rad"
        yield f"# {_text(shaft)} = {_text(usual)}  # FILL IN: its unit"
    for name in contents.channels:
        if stated.get(name):
            yield f"{_text(name)} = {_text(stated[name])}"
        else:
            yield f'# {_text(name)} = "g"  # FILL IN: its unit, for labels of figures'


def _text(value: str) -> str:
    """Return a text as TOML."""
    return json.dumps(value, ensure_ascii=False)


def plot(contents: Contents, path: Path, most_panels: int = 12) -> None:
    """Draw the columns over time, or over the number of the sample, into a picture.

    Parameters
    ----------
    contents : Contents
        What was found in a file.
    path : Path
        The picture.
    most_panels : int
        Most columns that are drawn.

    Raises
    ------
    ImportError
        If matplotlib is not installed.
    """
    from emacm.displays import _drawing
    from emacm.displays.recording import extremes

    drawn = [column for column in contents.numbers.items() if column[0] != contents.times]
    drawn = drawn[:most_panels]
    axes = _drawing.panel_axes(None, len(drawn), height=1.3)
    timed = all(name in contents.rates for name, _ in drawn)
    for panel, (name, values) in zip(axes, drawn, strict=True):
        rate = contents.rates[name] if timed else 1.0
        numbers, shown = extremes(np.arange(len(values)) / rate, values)
        panel.plot(numbers, shown, color=_drawing.PLAIN, linewidth=0.8)
        panel.set_xlim(0, max(len(values) - 1, 1) / rate)
        _drawing.label_y(panel, name, contents.columns.units.get(name, "unit"))
    _drawing.label_x(axes, "time [s]" if timed else "sample")
    with written_whole(path) as unfinished:
        axes[0].figure.savefig(unfinished, dpi=150, format=path.suffix[1:] or "png")
