"""Rates with confidence intervals, one line for each hold-out scheme or evaluation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from emacm.displays import _drawing

# Rate: label, colour and marker.
RATES = {
    "balanced_accuracy": ("balanced accuracy", _drawing.PLAIN, "o"),
    "accuracy": ("accuracy", _drawing.COLOURS[5], "D"),
    "false_alarm_rate": ("false alarms (of healthy)", _drawing.COLOURS[4], "s"),
    "inspection_rate": ("inspections (of healthy)", "0.4", "v"),
    "missed_detection_rate": ("missed detections (of faulty)", _drawing.COLOURS[1], "^"),
}
SHOWN = ("balanced_accuracy", "false_alarm_rate", "inspection_rate", "missed_detection_rate")
CENTRED = {"ha": "center", "va": "center", "fontsize": _drawing.SMALL}
INCHES = 0.19  # for each rate of a line


def checked_rates(table: pd.DataFrame, figures: Sequence[str] | None) -> list[str]:
    """Return the rates to draw; None stands for those of `SHOWN` that the table has.

    Raises
    ------
    ValueError
        If one is not a rate, the table has no such columns, or a value is not from 0 to 1.
    """
    if figures is None:
        figures = [name for name in SHOWN if name in table] or ["accuracy"]
    names = [figures] if isinstance(figures, str) else list(figures)
    columns = [f"{name}{end}" for name in names for end in ("", "_low", "_high")]
    missing = [column for column in columns if column not in table]
    if not names or missing or not set(names) <= set(RATES):
        raise ValueError(
            f"figures must be among {list(RATES)}, with intervals in table; got {names}"
            + (f", and the table has no {missing}." if missing else ".")
        )
    known = table[columns].to_numpy(float)
    if not np.isfinite(known).any() or (known < 0).any() or (known > 1).any():
        raise ValueError(
            f"table must hold shares from 0 to 1 in {columns}, and at least one; got "
            f"{known.tolist()}."
        )
    return names


def rate_frame(table: pd.DataFrame, figures: Sequence[str], name: str) -> pd.DataFrame:
    """Return one row for each line and figure of merit: its value and the limits of its interval.

    Parameters
    ----------
    table : DataFrame
        One row for each line; columns ``accuracy``, ``accuracy_low``, ``accuracy_high``.
    figures : sequence of str
        Figures of merit.
    name : str
        Name of the column with the names of the lines.
    """
    rows = [
        (line, figure, *row[[figure, f"{figure}_low", f"{figure}_high"]])
        for line, row in table.iterrows()
        for figure in figures
    ]
    return pd.DataFrame(rows, columns=[name, "figure", "value", "low", "high"])


def draw_rates(panel: Any, table: pd.DataFrame, figures: Sequence[str]) -> None:
    """Draw rates in per cent with their intervals, the first line on top, and a legend above."""
    heights, n_figures = np.arange(len(table)), len(figures)
    for number, name in enumerate(figures):
        columns = (name, f"{name}_low", f"{name}_high")
        value, low, high = (100 * table[column].to_numpy(float) for column in columns)
        if np.isnan(value).all():
            continue
        label, colour, marker = RATES[name]
        places = heights + (number - (n_figures - 1) / 2) * 0.6 / n_figures
        panel.hlines(places, low, high, linewidth=1.6, color=colour, zorder=3)
        panel.plot(value, places, marker, label=label, color=colour, zorder=3)
    for height in heights[table[list(figures)].isna().all(axis=1)]:
        panel.text(50, height, "cannot be scored", **CENTRED)
    name_lines(panel, table)
    panel.set_xlim(-2, 102)
    panel.set_xlabel("share of the recordings [%]")
    _drawing.legend_above(panel, title="line: confidence interval")


def name_lines(panel: Any, table: pd.DataFrame) -> None:
    """Name the lines at the y axis, with the groups on which the intervals are based."""
    heights = np.arange(len(table))
    panel.set_yticks(heights, [_named(name, row) for name, row in table.iterrows()])
    panel.tick_params(axis="y", labelsize=_drawing.SMALL, length=0)
    panel.set_ylim(len(heights) - 0.5, -0.5)  # the first on top
    panel.grid(axis="x", color="0.9", linewidth=0.6)
    for height in heights[1:] - 0.5:
        panel.axhline(height, color="0.8", linewidth=0.6)


def _named(name: Any, row: pd.Series) -> str:
    if not row.get("groups") or "resampled" not in row:
        return _drawing.wrapped(name)
    return f"{_drawing.wrapped(name)}\n({row['resampled']}s: {row['groups']})"
