"""Public data sets in the Parquet form of the package bearing-datasets [1]_.

A data set is a folder with ``metadata.parquet``, one row for each signal, and
``signals/part-<dtype>.parquet``, in which a row holds the samples of one signal.

References
----------
.. [1] V. Bauler, bearing-datasets, https://github.com/VictorBauler/BearingDatasets.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from emacm.recordings.file_columns import FileColumns
from emacm.recordings.files import FileRecording, open_part
from emacm.recordings.layout import Layout
from emacm.recordings.readers import RefusedFileError, optional_library

_OF_SIGNALS = {  # columns that differ between the channels of a recording, or locate samples
    *("signal_id", "channel", "fs", "n_samples", "unit", "quantity", "axis", "sensitivity"),
    *("sensor_location", "sensor_mounting", "sensor_at_fault"),
    *("signal_file", "signal_row_group", "signal_row"),
}
_OLD_NAMES = {"condition": "fault_type", "severity": "fault_severity", "rpm": "speed_rpm"}


def open_bearing_dataset(
    folder: str | os.PathLike[str],
    layout: Layout | None = None,
    *,
    where: Mapping[str, Any] | None = None,
) -> list[FileRecording]:
    """Open the recordings of a data set that the package bearing-datasets has built.

    Parameters
    ----------
    folder : str or Path
        Folder of one data set, with ``metadata.parquet`` and ``signals``.
    layout : Layout, optional
        Which channels, and the motion of the shaft. Default: all channels, and the constant speed
        "speed_rpm" of the metadata. Rates and units are those of the data set.
    where : mapping of str to object, optional
        Only recordings with these values of metadata, as ``{"bearing_id": ["K001", "KA01"]}``.

    Returns
    -------
    list of Recording
        Their samples are read when they are needed; `meta` holds the columns of the metadata that
        are the same for all channels of a recording: recording_id, fault_type, bearing_id, ...

    Raises
    ------
    FileNotFoundError
        If the folder has no metadata.
    ImportError
        If pyarrow is not installed (extra ``files``).
    ValueError
        If the metadata lack a column, or no recording is left.
    """
    optional_library("pyarrow.parquet", "Parquet")
    path = Path(folder).absolute() / "metadata.parquet"
    if not path.is_file():
        raise FileNotFoundError(
            f"{str(folder)!r} has no metadata.parquet; it was not built by bearing-datasets."
        )
    table = _metadata(path)
    for name, value in (where or {}).items():
        if name not in table.columns:
            raise ValueError(f"where names {name!r}; the metadata have {list(table.columns)}.")
        table = table[table[name].isin(value if isinstance(value, list | tuple | set) else [value])]
    if table.empty:
        raise ValueError(f"no recording of {str(folder)!r} has {dict(where or {})}.")
    chosen = Layout(velocity="speed_rpm") if layout is None else layout
    common = [name for name in table.columns if name not in _OF_SIGNALS]
    return [
        open_part(path, str(number), chosen, _meta(rows, common))
        for number, rows in table.groupby("recording_id", sort=False)
    ]


def _meta(rows: pd.DataFrame, names: list[str]) -> dict[str, Any]:
    first = rows[names].astype(object).iloc[0]
    return {name: first[name] for name in names if rows[name].nunique(dropna=False) == 1}


def _metadata(path: Path) -> pd.DataFrame:
    table = pd.read_parquet(path)
    old = {name: new for name, new in _OLD_NAMES.items() if new not in table.columns}
    table = table.rename(columns=old)
    needed = ("recording_id", "channel", "fs", "signal_file", "signal_row_group", "signal_row")
    missing = [name for name in needed if name not in table.columns]
    if missing:
        raise ValueError(f"{path} lacks the columns {missing} of bearing-datasets.")
    return table


def read_part(path: Path, recording_id: str) -> FileColumns:
    """Return the signals of one recording of a data set.

    Parameters
    ----------
    path : Path
        The metadata.
    recording_id : str
        Which recording.

    Returns
    -------
    FileColumns
        A column for each channel, with its rate and unit; the speed as a number, if the channels
        that state it agree.
    """
    parquet = optional_library("pyarrow.parquet", "Parquet")
    table = _metadata(path)
    rows = table[table["recording_id"].astype(str) == recording_id]
    if rows.empty:
        raise RefusedFileError(f"it has no recording {recording_id!r} any more.")
    content = FileColumns({})
    for row in rows.to_dict("records"):
        file = parquet.ParquetFile(path.parent / "signals" / row["signal_file"])
        group = file.read_row_group(row["signal_row_group"], columns=["signal"])
        samples = group.column(0).combine_chunks()
        first, last = samples.offsets[row["signal_row"]], samples.offsets[row["signal_row"] + 1]
        values = samples.values[first.as_py() : last.as_py()]  # noqa: PD011
        content.columns[row["channel"]] = values.to_numpy(zero_copy_only=False)
        content.rates[row["channel"]] = float(row["fs"])
        if row.get("unit") not in (None, "unknown", "counts", "normalized"):
            content.units[row["channel"]] = row["unit"]
    stated = pd.to_numeric(rows.get("speed_rpm", pd.Series(dtype=float)), errors="coerce")
    speeds = stated[np.isfinite(stated)].unique()
    if len(speeds) == 1:  # channels that contradict one another leave it unknown
        content.numbers["speed_rpm"] = float(speeds.item())
        content.units["speed_rpm"] = "rpm"
    return content
