"""Readers of Parquet, HDF5, TDMS, UFF 58 and MDF 4 files, each by its library."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from emacm.recordings.file_columns import FileColumns
from emacm.recordings.readers import RefusedFileError, add_array, optional_library, settled
from emacm.recordings.sample_times import rate_of_times

_RATE_KEYS = ("fs", "sampling_rate", "sample_rate", "samplerate", "sampling_frequency", "rate")
_UNIT_KEYS = ("unit", "units", "Unit", "Units")
_DOUBLE, _UFF = 15, 6  # digits of a time between samples: as a number, and in a UFF file
_TIME_RESPONSE = 58  # type of a data set of a UFF file


def read_parquet(path: Path) -> FileColumns:
    """Return the columns of a Parquet file.

    Units are taken from the metadata "unit" of the fields; rates and units also from the
    metadata of the file and from ``DataFrame.attrs`` ("fs", "units").
    """
    parquet = optional_library("pyarrow.parquet", "Parquet")
    table = parquet.ParquetFile(path).read()
    if len(set(table.column_names)) < len(table.column_names):
        raise RefusedFileError(f"its columns must have different names, got {table.column_names}.")
    content = FileColumns({})
    for field, column in zip(table.schema, table.columns, strict=True):
        if str(field.type).startswith("decimal"):
            column = column.cast("float64")
        if str(field.type) == "null":
            content.ignored[field.name] = "is empty"
            continue
        values = column.to_numpy()
        if values.dtype == object and len(values) and not isinstance(values[0], str):
            content.ignored[field.name] = f"holds values of the type {field.type}"
            continue
        content.columns[field.name] = values
        for key, value in (field.metadata or {}).items():
            if key.decode() in _UNIT_KEYS:
                content.units[field.name] = value.decode()
    if content.ignored and not any(v.dtype.kind in "iuf" for v in content.columns.values()):
        name, reason = next(iter(content.ignored.items()))
        raise RefusedFileError(
            f"column {name!r} {reason}. If it is a data set of bearing-datasets, open its folder "
            f"by emacm.open_bearing_dataset."
        )
    stored = {k.decode(): v.decode() for k, v in (table.schema.metadata or {}).items()}
    pandas = json.loads(stored.get("pandas", "{}"))
    _add_attributes(content, "", stored | (pandas.get("attributes") or {}))
    return settled(content)


def read_hdf5(path: Path) -> FileColumns:
    """Return the numeric data sets of an HDF5 file as "group/name".

    Attributes "fs" (or sampling_rate) and "unit" of a data set hold for it, those of a group for
    all of its data sets.
    """
    h5py = optional_library("h5py", "HDF5")
    content = FileColumns({})

    def add(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset):
            before = set(content.columns)
            add_array(content, name, node[()])
            for column in set(content.columns) - before:
                _add_attributes(content, column, node.attrs, own=True)
        elif isinstance(node, h5py.Group):
            _add_attributes(content, f"{name}/", node.attrs)

    with h5py.File(path, "r") as file:
        _add_attributes(content, "", file.attrs)
        file.visititems(add)
    return settled(content)


def read_tdms(path: Path) -> FileColumns:
    """Return the channels of a TDMS file; as "group/channel" if a name occurs twice."""
    nptdms = optional_library("nptdms", "TDMS")
    content = FileColumns({})
    with nptdms.TdmsFile.open(path) as file:
        channels = [channel for group in file.groups() for channel in group.channels()]
        names = [channel.name for channel in channels]
        for channel in channels:
            twice = names.count(channel.name) > 1
            name = f"{channel.group_name}/{channel.name}" if twice else channel.name
            add_array(content, name, channel[:])
            properties = channel.properties
            if name in content.columns and properties.get("wf_increment"):
                content.rates[name] = _rate(float(properties["wf_increment"]), _DOUBLE)
            unit = properties.get("unit_string") or properties.get("NI_UnitDescription")
            if unit:
                content.units[name] = str(unit)
    return settled(content)


def read_uff(path: Path) -> FileColumns:
    """Return the data sets of type 58 with evenly spaced times; named by their first line."""
    pyuff = optional_library("pyuff", "UFF 58")
    content = FileColumns({})
    sets = pyuff.UFF(str(path)).read_sets()
    for number, one in enumerate(sets if isinstance(sets, list) else [sets]):
        if one.get("type") != _TIME_RESPONSE:
            continue
        name = str(one.get("id1", "")).strip()
        if not name or name.upper() == "NONE" or name in content.columns:
            name = f"x{number}"
        add_array(content, name, one["data"])
        step = float(one.get("abscissa_inc") or 0)
        times = np.asarray(one.get("x", ()), float)
        if one.get("abscissa_spacing") == 1 and step > 0:
            content.rates[name] = _rate(step, _UFF)
        elif len(times) > 1:
            content.rates[name] = rate_of_times(times - times[0], f"abscissa of {name}")
        unit = str(one.get("ordinate_axis_units_lab", "")).strip()
        if unit and unit.upper() != "NONE":
            content.units[name] = unit
    return settled(content)


def read_mdf(path: Path) -> FileColumns:
    """Return the channels of an MDF 4 file, with rates from their time stamps."""
    asammdf = optional_library("asammdf", "MDF", extra="mdf")
    content = FileColumns({})
    with asammdf.MDF(str(path)) as file:
        for signal in file.iter_channels():
            values = np.asarray(signal.samples)
            if values.dtype.kind not in "biuf" or len(values) < 2:
                continue
            name = signal.name if signal.name not in content.columns else f"{signal.name}.2"
            times = np.asarray(signal.timestamps, float)
            content.columns[name] = values
            content.rates[name] = rate_of_times(times - times[0], f"time stamps of {name}")
            if signal.unit:
                content.units[name] = str(signal.unit)
    return settled(content)


def _rate(step: float, digits: int) -> float:
    """Return the roundest rate [Hz] with this time between samples [s], stored with some digits.

    Examples
    --------
    >>> _rate(8.33333e-05, 6), _rate(1 / 48_828.125, 15)
    (12000.0, 48828.125)
    """
    for n_digits in range(2, digits):
        nominal = float(f"{1 / step:.{n_digits}g}")
        if f"{1 / nominal:.{digits - 1}e}" == f"{step:.{digits - 1}e}":
            return nominal
    return 1 / step


def _add_attributes(
    content: FileColumns, place: str, attributes: Mapping[str, Any], *, own: bool = False
) -> None:
    """Add what attributes state on rates and units of a column, or of a group of columns."""
    only_rate = [key for key in _RATE_KEYS if key in attributes] == ["rate"]
    for key in attributes:
        value = attributes[key]
        value = value.decode() if isinstance(value, bytes) else value
        if key in _RATE_KEYS:
            number = _number(key, value, place)
            if not own:
                for name in (key, "fs") if only_rate else (key,):
                    content.numbers[f"{place}{name}"] = number
            elif key != "rate" or only_rate:  # beside another one, it may be of something else
                content.rates[place] = number
        elif key in _UNIT_KEYS:
            content.units |= dict(_units(place, value))


def _number(key: str, value: Any, place: str) -> float:
    """Return the rate that an attribute states."""
    try:
        rates = np.unique(np.asarray(value, np.float64))
    except (TypeError, ValueError):
        rates = np.empty(0)
    if len(rates) != 1:
        raise RefusedFileError(
            f"the attribute {key!r}{f' of {place!r}' if place else ''} is {value!r}; expected was "
            f"one number, the sampling rate in Hz. Correct the file."
        )
    return float(rates[0])


def _units(place: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, str) and value.startswith("{"):
        value = json.loads(value)
    if isinstance(value, Mapping):
        yield from ((f"{place}{name}", str(unit)) for name, unit in value.items())
    elif isinstance(value, str):
        yield place, value
