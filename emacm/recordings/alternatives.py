"""Names in a layout that are alternatives, as "vibration|x0": files of several formats differ."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from emacm.recordings.column_names import split_unit
from emacm.recordings.layout import Layout

_NUMBER = re.compile(r"\s*([+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)\s*([^\d\s].*)?")


def constant_speed(text: str) -> tuple[float, str] | None:
    """Return a speed such as "1797 rpm" as a number and its unit; None if it is a name.

    Examples
    --------
    >>> constant_speed("1797 rpm"), constant_speed("157"), constant_speed("speed")
    ((1797.0, 'rpm'), (157.0, 'rad/s'), None)
    """
    found = _NUMBER.fullmatch(text)
    return None if found is None else (float(found[1]), (found[2] or "rad/s").strip())


def with_names_of(layout: Layout, has: Callable[[str], bool]) -> Layout:
    """Return a layout with one name in place of alternatives: the first that the file has.

    Parameters
    ----------
    layout : Layout
        Its columns may be alternatives, separated by "|"; the last one of `velocity` may be a
        constant speed, for files without a column of it.
    has : callable
        Tells whether the file has a column or number of a name.

    Returns
    -------
    Layout
        Alternatives none of which the file has are kept as they are.

    Examples
    --------
    >>> layout = Layout(channels=["vibration|x0"], velocity="speed|1500 rpm")
    >>> chosen = with_names_of(layout, {"x0", "x1"}.__contains__)
    >>> chosen.channels, chosen.velocity
    ({'vibration': 'x0'}, '1500 rpm')
    """

    def one(value: Any) -> Any:
        if not isinstance(value, str) or "|" not in value or has(value):
            return value
        names = [name.strip() for name in value.split("|")]
        return next((name for name in names if has(name) or constant_speed(name)), value)

    changes = {name: one(getattr(layout, name)) for name in ("fs", "time", "velocity", "angle")}
    tacho, channels = layout.tacho, layout.channels
    if isinstance(tacho, Mapping):
        changes["tacho"] = {**tacho, "column": one(tacho["column"])}
    else:
        changes["tacho"] = one(tacho)
    if channels is not None and not isinstance(channels, Mapping):
        channels = {split_unit(name.partition("|")[0])[0]: name for name in channels}
    if channels is not None:
        changes["channels"] = {name: one(column) for name, column in channels.items()}
    return replace(layout, **changes)
