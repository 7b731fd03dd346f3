"""Files with actions, parts of a machine and earlier results, for reports."""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict
from inspect import signature
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from emacm._checks import check_number, located
from emacm.files.folder import open_recording
from emacm.files.layout import Layout, read_toml
from emacm.files.sample_times import stated_date
from emacm.history.sqlite_history import History, is_history
from emacm.machine.gears import Gear, PlanetaryGear
from emacm.machine.motors import InductionMotor, Motor
from emacm.machine.parts import Part
from emacm.machine.rolling import BallScrew, Bearing, bearing_of

_PARTS = (Bearing, BallScrew, Gear, PlanetaryGear, Motor, InductionMotor)


def read_actions(path: Path) -> dict[str, Any]:
    """Read recommended actions from a TOML file.

    Parameters
    ----------
    path : Path
        With lines ``decision = "text"``, at the top or in a table ``[actions]``.

    Returns
    -------
    dict of str to str

    Raises
    ------
    OSError
        If it cannot be read.
    ValueError
        If it has no actions.
    """
    with located(str(path)):
        content = read_toml(path)
        actions = content.get("actions", content)
        if not isinstance(actions, dict) or not actions:
            raise ValueError('it must hold actions, as in: worn = "Replace the bearing."')
        return actions


def read_parts(path: Path) -> list[Any]:
    """Read the parts of a machine from a TOML file.

    Parameters
    ----------
    path : Path
        Tables ``[[Bearing]]``, ``[[Gear]]`` and so on with the parameters of these classes, the
        contact angle as ``contact_angle_deg``, and ``designation = "6205"`` for the geometry of a
        published bearing; and ``[orders]`` with orders by name.

    Returns
    -------
    list of Part or dict

    Raises
    ------
    OSError
        If it cannot be read.
    TypeError, ValueError
        If it has another content; the message names the table.
    """
    kinds: dict[str, type[Part]] = {kind.__name__: kind for kind in _PARTS}
    parts: list[Any] = []
    with located(str(path)):
        for name, tables in read_toml(path).items():
            if name == "orders":
                parts.append(tables)
                continue
            if name not in kinds:
                raise ValueError(
                    f"it has a table {name!r}; possible are 'orders', [[Bearing]] or {list(kinds)}."
                )
            with located(name):
                for one in map(dict, np.ravel(tables)):
                    parameters = signature(kinds[name]).parameters
                    designation = one.pop("designation", None) if name == "Bearing" else None
                    # Angles are in degrees outside of Python.
                    known = [key.replace("_angle", "_angle_deg") for key in parameters]
                    if unknown := [key for key in one if key not in known]:
                        raise ValueError(f"{unknown[0]!r} is not known; possible are {known}.")
                    if (angle := one.pop("contact_angle_deg", None)) is not None:
                        limits: Any = {"at_least": 0, "below": 90, "unit": "degrees"}
                        angle = check_number(angle, "contact_angle_deg", **limits)
                        one["contact_angle"] = radians(angle)
                    if designation:
                        one = asdict(bearing_of(str(designation))) | one
                    needed = [key for key, each in parameters.items() if each.default is each.empty]
                    if missing := [key for key in needed if key not in one]:
                        raise ValueError(f"{missing[0]!r} is missing; needed are {needed}.")
                    parts.append(kinds[name](**one))
        if not parts:
            raise ValueError("it holds no part; write a table such as [[Bearing]].")
    return parts


def read_results(path: Path) -> pd.DataFrame:
    """Read a table of ``emacm score``: CSV, JSON lines, or a history of SQLite.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    DataFrame

    Raises
    ------
    OSError
        If it cannot be read.
    ValueError
        If it is of another type, or has no columns "recording" and "decision".
    """
    with located(str(path)):
        if path.suffix == ".csv":
            table = pd.read_csv(path, keep_default_na=False, dtype={"decision": str}).map(of_cell)
        elif path.suffix == ".jsonl":
            table = pd.read_json(path, lines=True, dtype=False)
        elif is_history(path):
            table = pd.DataFrame(History(path).records())
        else:
            raise ValueError("a table of results must end with .csv, .jsonl or .sqlite.")
        if not {"recording", "decision"} <= set(table.columns):
            raise ValueError(
                f"it is not a table of emacm score; it has the columns {list(table.columns)}."
            )
    return table


# What a spreadsheet takes for a formula, or such a text that was marked as none
_FORMULA = r"(?='*([=@]|[+-](?![\d.]*\Z)))"


def as_cell(value: Any) -> Any:
    """Return a value as a cell of a CSV table: texts like formulas have a ' in front.

    Examples
    --------
    >>> as_cell("=1+1.csv"), as_cell("-1"), of_cell(as_cell("=1+1.csv"))
    ("'=1+1.csv", '-1', '=1+1.csv')
    """
    return re.sub(f"^{_FORMULA}", "'", value) if isinstance(value, str) else value


def of_cell(value: Any) -> Any:
    """Return the value that `as_cell` was given."""
    return re.sub(f"^'{_FORMULA}", "", value) if isinstance(value, str) else value


def with_units_and_times(
    table: pd.DataFrame, layout: Layout, unit: str | None, time: str | None
) -> pd.DataFrame:
    """Add the unit and the time of each recording to a table of results.

    Parameters
    ----------
    table : DataFrame
        With the column "recording", paths of files.
    layout : Layout
        Whose `meta` names units and times.
    unit : str, optional
        Key of meta. None: the column is left out.
    time : str, optional
        Key of meta. None: the time at which the recording started, if the file states it; else
        that at which the file was written.

    Returns
    -------
    DataFrame
        Without recordings whose time is not known because the file is gone.

    Raises
    ------
    ValueError
        If a meta has no such key; the message names the file.
    """
    paths = table["recording"].astype(str).map(Path)
    kept = paths[[time is not None or path.exists() for path in paths]]
    units, times = units_and_times(kept, layout, unit, time)
    found = table.loc[kept.index].assign(time=times)
    return found if units is None else found.assign(unit=units)


def units_and_times(
    paths: Iterable[Path], layout: Layout, unit: str | None, time: str | None
) -> tuple[list[Any] | None, list[Any]]:
    """Return unit and time of each file, as `with_units_and_times`; now if the file is not there.

    Raises
    ------
    ValueError
        If a meta has no such key; the message names the file.
    """
    units = None if unit is None else [meta_value(path, layout, unit) for path in paths]
    if time is None:
        return units, [_started(path, layout) for path in paths]
    times = [meta_value(path, layout, time) for path in paths]
    if all(isinstance(value, str) for value in times):
        try:  # texts have another order: "10" would be before "9"
            times = list(map(float, times))
        except ValueError:
            times = [stated_date(value, time) for value in times]
    return units, times


def meta_value(path: Path, layout: Layout, key: str) -> Any:
    """Return the value of a key of the meta of a file."""
    with located(str(path)):
        meta = layout.meta_of(path)
        if key not in meta:
            known = f", only {list(meta)}" if meta else ""
            raise ValueError(
                f"its meta has no {key!r}{known}: the layout does not say which part of the file "
                f"name it is, as in meta = '{{unit}}_{{state}}_{{run:d}}', or the name differs."
            )
        if pd.isna(meta[key]) or meta[key] == "":
            raise ValueError(f"its {key!r} is empty. State it, or leave the file out.")
        return meta[key]


def unit_named(path: Path, layout: Layout, key: str | None) -> str:
    """Return the unit that the meta of a file names, by default under "unit"; "" if it does not.

    Raises
    ------
    ValueError
        If the key is given, and the meta has none.
    """
    try:
        meta = layout.meta_of(path)
    except ValueError:  # of a name that matches in several ways; its row states it
        return ""
    return str(meta.get("unit", "") if key is None else meta_value(path, layout, key))


def _started(path: Path, layout: Layout) -> pd.Timestamp:
    if not path.exists():
        return pd.Timestamp.now("UTC").tz_localize(None)
    with suppress(ImportError, OSError, TypeError, ValueError):  # its row or page states why
        start = open_recording(path, layout).start
        if start is not None:
            return start
    return pd.Timestamp(path.stat().st_mtime, unit="s")  # UTC, as in records
