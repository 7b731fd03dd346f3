"""Files with actions, parts of a machine and earlier results, for reports."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from emacm._checks import located
from emacm.files.layout import Layout
from emacm.machine.gears import Gear, PlanetaryGear
from emacm.machine.motors import InductionMotor, Motor
from emacm.machine.parts import Part
from emacm.machine.rolling import BallScrew, Bearing

_PARTS = (Bearing, BallScrew, Gear, PlanetaryGear, Motor, InductionMotor)
_ORDERS = "orders"  # table of names with orders


def read_actions(path: Path) -> dict[str, str]:
    """Read recommended actions from a TOML file or a CSV table.

    Parameters
    ----------
    path : Path
        TOML: ``decision = "text"``, at the top or in a table ``[actions]``; CSV: columns
        "decision" and "action".

    Returns
    -------
    dict of str to str

    Raises
    ------
    OSError
        If it cannot be read.
    ValueError
        If it is neither, or has no actions.
    """
    with located(str(path)):
        if path.suffix == ".csv":
            table = pd.read_csv(path, dtype=str, keep_default_na=False)
            if not {"decision", "action"} <= set(table.columns):
                raise ValueError(
                    f"it must have the columns 'decision' and 'action', got {list(table.columns)}."
                )
            return dict(zip(table["decision"], table["action"], strict=True))
        content = _toml(path)
        found = content.get("actions", content)
        if not isinstance(found, Mapping) or not found:
            raise ValueError('it must hold actions, as in: worn = "Replace the bearing."')
        return {str(label): text for label, text in found.items()}


def read_parts(path: Path) -> list[Any]:
    """Read the parts of a machine from a TOML file.

    Parameters
    ----------
    path : Path
        Tables ``[[Bearing]]``, ``[[Gear]]`` and so on with the parameters of these classes; and
        ``[orders]`` with orders by name.

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
    with located(str(path)):
        content, found = _toml(path), []
        for name, tables in content.items():
            if name == _ORDERS:
                found.append(tables)
                continue
            if name not in kinds:
                raise ValueError(
                    f"it has a table {name!r}; possible are {[*kinds, _ORDERS]}, as in [[Bearing]]."
                )
            for table in tables if isinstance(tables, list) else [tables]:
                with located(name):
                    found.append(kinds[name](**table))
        if not found:
            raise ValueError("it holds no part; write a table such as [[Bearing]].")
        return found


def read_results(path: Path) -> pd.DataFrame:
    """Read a table of ``emacm score``: CSV, JSON lines or Parquet.

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
        if path.suffix == ".parquet":
            table = pd.read_parquet(path)
        elif path.suffix == ".jsonl":
            table = pd.read_json(path, lines=True, dtype=False)
        elif path.suffix == ".csv":
            table = pd.read_csv(path, keep_default_na=False, dtype={"decision": str})
        else:
            raise ValueError("a table of results must end with .csv, .jsonl or .parquet.")
        if not {"recording", "decision"} <= set(table.columns):
            raise ValueError(
                f"it is not a table of emacm score, whose columns are 'recording', 'decision' and "
                f"others; got {list(table.columns)}."
            )
        return table


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
        Key of meta. None: the time when the file was written.

    Returns
    -------
    DataFrame
        Without recordings whose time is not known because the file is gone.

    Raises
    ------
    ValueError
        If a meta has no such key; the message names the file.
    """
    names = table["recording"].astype(str).tolist()
    kept = [time is not None or os.path.exists(name) for name in names]
    paths = [Path(name) for name, keep in zip(names, kept, strict=True) if keep]
    columns = {} if unit is None else {"unit": [value_of(path, layout, unit) for path in paths]}
    times = [time_of(path, layout, time) for path in paths]
    return table.loc[kept].assign(**columns, time=times)


def value_of(path: Path, layout: Layout, key: str) -> Any:
    """Return the value of a key of the meta of a file."""
    with located(str(path)):
        meta = layout.meta_of(path)
        if key not in meta:
            raise ValueError(
                f"its meta has no {key!r}, only {list(meta)}. State it by meta in the layout."
            )
        return meta[key]


def time_of(path: Path, layout: Layout, key: str | None) -> Any:
    """Return the time of a recording: of its meta, or when its file was written (local time)."""
    if key is not None:
        return value_of(path, layout, key)
    return pd.Timestamp.fromtimestamp(os.stat(path).st_mtime)


def _toml(path: Path) -> dict[str, Any]:
    with open(path, "rb") as file:
        try:
            return tomllib.load(file)
        except tomllib.TOMLDecodeError as error:
            raise ValueError(f"it is not valid TOML: {error}.") from error


def known_times(paths: Sequence[Path], layout: Layout, key: str | None) -> list[Any]:
    """Return the time of each file; that of a file that is not there is now."""
    return [
        pd.Timestamp.now() if key is None and not path.exists() else time_of(path, layout, key)
        for path in paths
    ]
