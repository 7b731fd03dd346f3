"""Whether recordings can tell a state of health from the unit that was in it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd

_EXAMPLES = 3


def single_unit_labels(labels: Sequence[Any], units: Sequence[Any]) -> dict[Any, Any]:
    """Find the labels that only one unit has ever had.

    Parameters
    ----------
    labels : sequence of n_recordings
        Label (state of health) of each recording.
    units : sequence of n_recordings
        Unit (machine, assembly) of each recording.

    Returns
    -------
    dict
        {label: its only unit}.

    Examples
    --------
    >>> single_unit_labels(["new", "new", "worn", "worn"], ["A", "B", "C", "C"])
    {'worn': 'C'}
    """
    pairs = pd.DataFrame({"label": list(labels), "unit": list(units)}).drop_duplicates()
    alone = pairs[~pairs["label"].duplicated(keep=False)]
    return dict(zip(alone["label"], alone["unit"], strict=True))


def single_label_units(labels: Sequence[Any], units: Sequence[Any]) -> dict[Any, Any]:
    """Find the units that only one label was ever recorded on.

    Examples
    --------
    >>> single_label_units(["new", "worn", "worn", "worn"], ["A", "A", "B", "B"])
    {'B': 'worn'}
    """
    return single_unit_labels(units, labels)


def confounding(labels: Sequence[Any], units: Sequence[Any], unit: str) -> list[str]:
    """Say in words what in the labels may be the unit instead.

    Parameters
    ----------
    labels, units : sequence of n_recordings
        As for `single_unit_labels`.
    unit : str
        What a unit is called.

    Returns
    -------
    list of str
        The gravest first; empty if labels and units are crossed.

    Examples
    --------
    >>> confounding(["new", "worn"] * 2, ["A", "A", "B", "B"], "unit")
    []
    """
    said = []
    alone = single_unit_labels(labels, units)
    if alone:
        which = _examples([f"{label!r} in {owner!r} alone" for label, owner in alone.items()])
        said.append(
            f"Label and {unit} are confounded: {which}. What sets such a label apart may be the "
            f"{unit} itself, and no split of these recordings can show which."
        )
    single = single_label_units(labels, units)
    if len(single) == len(set(units)):
        which = _examples([f"{owner!r} was only ever {label!r}" for owner, label in single.items()])
        said.append(
            f"Each {unit} has one label: {which}. A split with the same {unit} on both sides may "
            f"score by recognising the {unit}; only a split by {unit} is free of it."
        )
    return said


def _examples(parts: list[str]) -> str:
    more = len(parts) - _EXAMPLES
    return ", ".join(parts[:_EXAMPLES]) + (f" and {more} more" if more > 0 else "")
