"""Readers of npz, WAV, MAT, Parquet, HDF5, TDMS, UFF 58 and MDF 4 files."""

from __future__ import annotations

import importlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np
import pandas as pd
import scipy  # scipy.io is imported when it is used

from emacm._statements import warn
from emacm.files.file_columns import FileColumns, RefusedFileError, missing_codes
from emacm.recordings.names import is_time_name, printable

_RATE_KEYS = ("fs", "sampling_rate", "sample_rate", "samplerate", "sampling_frequency", "rate")
_ABSCISSAS = {17: "", 18: "frequency", 19: "rpm", 20: "order"}  # of UFF
_UNIT_KEYS = ("unit", "units", "Unit", "Units")


def optional_library(name: str, kind: str, extra: str = "files") -> Any:
    """Import the library that reads a type of file, or name the extra that installs it."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(
            f"{kind} files are read by {name.partition('.')[0]}, which is not installed; run "
            f"pip install 'emacm[{extra}]'."
        ) from error


def add_array(content: FileColumns, name: str, values: Any) -> None:
    """Add a numeric array to the content of a file, its fields, or a single number.

    Of two dimensions, the columns are those along the shorter one. What is not added is noted with
    the reason.

    Examples
    --------
    >>> content = FileColumns()
    >>> add_array(content, "vibration", np.zeros((2, 500)))
    >>> [*content.columns]
    ['vibration.0', 'vibration.1']
    """
    array = np.asarray(values)
    plain = np.squeeze(array)
    if array.dtype.names:
        for field in array.dtype.names:
            add_array(content, f"{name}.{field}", array[field])
    elif not array.size:
        content.ignored[name] = "is empty"
    elif array.dtype.kind == "M" and array.ndim == 1:
        content.put(name, array)
    elif array.dtype.kind == "m" and array.ndim == 1:
        content.put(name, array / np.timedelta64(1, "s"))
        content.units[name] = "s"
    elif array.dtype.kind not in "biufc":
        content.ignored[name] = f"holds no numbers, but {array.dtype}"
    elif array.size == 1 and array.dtype.kind != "c":
        content.numbers[name] = float(array.reshape(()))
    elif plain.ndim == 1:
        content.put(name, plain)
        if array.dtype.kind == "c":
            content.defects[name] = "is complex, as a spectrum: it is no signal over time"
    elif plain.ndim == 2:
        rows = plain if plain.shape[0] <= plain.shape[1] else plain.T
        for number, row in enumerate(rows):
            add_array(content, f"{name}.{number}", row)
    else:
        content.ignored[name] = f"has {array.ndim} dimensions {array.shape}"


def check_stated_size(path: Path, stated: float) -> None:
    """Refuse a file that states more than it can hold, and would fill the memory.

    Parameters
    ----------
    path : Path
        The file.
    stated : float
        Size of its arrays [bytes].

    Raises
    ------
    RefusedFileError
    """
    size = path.stat().st_size
    # Compressed measurements are below 20 times the size of the file; 256 MB do no harm.
    if stated > max(1 << 28, 200 * size):
        raise RefusedFileError(
            f"it states arrays of {stated / 1e9:.4g} GB, but has {size} bytes. It is damaged, or "
            f"made to fill the memory. Leave it out."
        )


def read_npz(path: Path, content: FileColumns) -> None:
    """Add the numeric arrays of an npz file."""
    with open(path, "rb") as file:  # which NumPy would leave open if it is damaged
        archive = np.load(file, allow_pickle=False)
        names = {member: member.removesuffix(".npy") for member in archive.zip.namelist()}
        if len(set(names.values())) < len(archive.files):
            raise RefusedFileError(f"its arrays must have different names, got {archive.files}.")
        check_stated_size(path, sum(member.file_size for member in archive.zip.infolist()))
        for member, name in names.items():
            add_array(content, name, archive[member])


def read_wav(path: Path, content: FileColumns) -> None:
    """Add the channels of a WAV file as x0, x1, ...; full scale of integers is 1.

    Lengths that were never written (0, or all bits) are those of a stream, or of a recorder that
    was stopped: all samples that follow are read, with a warning.
    """
    stored = bytearray(path.read_bytes())
    if stored[:4] == b"RIFF":
        _repair_lengths(stored, path)
        _check_complete(path, int.from_bytes(stored[4:8], "little") + 7)  # without a padding byte
    fs, samples = scipy.io.wavfile.read(BytesIO(stored))
    if samples.dtype.kind in "iu":  # full scale is 1
        content.is_relative = True
        middle = 128 if samples.dtype == np.uint8 else 0
        samples = (samples.astype(np.float64) - middle) / 2.0 ** (8 * samples.dtype.itemsize - 1)
    table = samples.reshape(len(samples), -1)
    content.columns.update((f"x{i}", np.ascontiguousarray(row)) for i, row in enumerate(table.T))
    content.rates.update(dict.fromkeys(content.columns, float(fs)))


def _repair_lengths(stored: bytearray, path: Path) -> None:
    """Write the lengths of a WAV file that were never written."""
    form = stored.find(b"fmt ") + 8
    start = stored.find(b"data", form) + 8  # of the samples
    of_file, of_samples = (int.from_bytes(stored[end - 4 : end], "little") for end in (8, start))
    if of_samples == 0xFFFFFFFF or (of_samples == 0 and len(stored) > start):
        frame = int.from_bytes(stored[form + 12 : form + 14], "little") or 1  # bytes of an instant
        del stored[len(stored) - (len(stored) - start) % frame :]
        stored[start - 4 : start] = (len(stored) - start).to_bytes(4, "little")
        text = "does not state its length, as a recorder that was stopped leaves it"
        warn("unfinished file", f"{printable(path)}: it {text}; all {len(stored)} bytes are read.")
    if of_file in (0, 0xFFFFFFFF):
        stored[4:8] = (len(stored) - 8).to_bytes(4, "little")


def read_mat(path: Path, content: FileColumns) -> None:
    """Add the numeric arrays of a MAT file; fields of structures as "structure.field".

    Elements of cells and of arrays of structures are numbered from 0, as "cell.0".

    Parameters
    ----------
    path : Path
        The file.
    content : FileColumns
        What is added to.
    """
    with open(path, "rb") as file:
        start = file.read(520)
    if b"\x89HDF\r\n\x1a\n" in (start[:8], start[512:]):
        read_hdf5(path, content, separator=".")
    else:
        check_stated_size(path, 8 * sum(math.prod(s) for _, s, _ in scipy.io.whosmat(path)))
        for name, value in scipy.io.loadmat(path, simplify_cells=True).items():
            if not name.startswith("__"):
                _add_variable(content, name, value)


def _add_variable(content: FileColumns, name: str, value: Any) -> None:
    if isinstance(value, Mapping):
        for field, inner in value.items():
            _add_variable(content, f"{name}.{field}", inner)
    elif isinstance(value, list) or getattr(value, "dtype", None) == "O":
        for number, inner in enumerate(value):  # cells, and arrays of structures
            _add_variable(content, f"{name}.{number}", inner)
    elif isinstance(value, np.ndarray | np.number | int | float):
        add_array(content, name, value)
    elif isinstance(value, str) and name.rpartition(".")[2].lower() in ("unit", "units"):
        content.units[name.rpartition(".")[0]] = value
    else:
        content.ignored[name] = f"holds no array of numbers, but {type(value).__name__}"


def read_parquet(path: Path, content: FileColumns) -> None:
    """Add the columns of a Parquet file.

    Units are taken from the metadata "unit" of the fields; rates and units also from the
    metadata of the file and from ``DataFrame.attrs`` ("fs", "units").
    """
    parquet = optional_library("pyarrow.parquet", "Parquet")
    with open(path, "rb") as file:
        stored = parquet.ParquetFile(file)
        check_stated_size(path, 8 * stored.metadata.num_rows * stored.metadata.num_columns)
        table = stored.read()
    if len(set(table.column_names)) < len(table.column_names):
        raise RefusedFileError(f"its columns must have different names, got {table.column_names}.")
    for field, column in zip(table.schema, table.columns, strict=True):
        if str(field.type).startswith("decimal"):
            column = column.cast("float64")
        values = column.to_numpy()
        if values.dtype == object and len(values) and not isinstance(values[0], str):
            content.ignored[field.name] = f"holds values of the type {field.type}"
            continue
        is_index = field.name.startswith("__index_level_") and values.dtype.kind in "mM"
        name = "time" if is_index and "time" not in table.column_names else field.name
        if values.dtype == object:
            content.columns[name] = values
        else:
            add_array(content, name, values)
        for key, value in (field.metadata or {}).items():
            if key.decode() in _UNIT_KEYS:
                content.units[name] = value.decode()
    stored = {k.decode(): v.decode() for k, v in (table.schema.metadata or {}).items()}
    _add_attributes(content, "", stored | json.loads(stored.get("PANDAS_ATTRS", "{}")))


def read_hdf5(path: Path, content: FileColumns, *, separator: str = "/") -> None:
    """Add the numeric data sets of an HDF5 file, such as MAT 7.3, as "group/name".

    Attributes "fs" (or sampling_rate) and "unit" of a data set hold for it, those of a group for
    all of its data sets.
    """
    h5py = optional_library("h5py", "HDF5 and MAT 7.3")
    with h5py.File(path, "r") as file:
        nodes: dict[str, Any] = {}
        file.visititems(nodes.__setitem__)
        sets = {place: node for place, node in nodes.items() if isinstance(node, h5py.Dataset)}
        groups = [file, *(node for node in nodes.values() if isinstance(node, h5py.Group))]
        links = [(key, group.get(key, getlink=True)) for group in groups for key in group]
        elsewhere = [key for key, link in links if isinstance(link, h5py.ExternalLink)]
        elsewhere += [place for place, one in sets.items() if one.external or one.is_virtual]
        if elsewhere:
            raise RefusedFileError(
                f"{elsewhere[0]!r} is stored in another file. Copy its samples into this one."
            )
        check_stated_size(path, sum(one.nbytes for one in sets.values()))
        _add_attributes(content, "", file.attrs)
        for place, node in nodes.items():
            name = place.replace("/", separator)
            kind = _decoded(node.attrs.get("MATLAB_class"))
            if place not in sets:
                _add_attributes(content, name + separator, node.attrs)
            elif place[0] != "#" and kind not in ("char", "cell"):
                before = {*content.columns, *content.numbers}
                add_array(content, name, _packed(node))
                for column in {*content.columns, *content.numbers} - before:
                    _add_attributes(content, column, node.attrs, own=True)


def _packed(node: Any) -> Any:
    """Return the values of an HDF5 data set by the CF conventions; NaN for missing ones."""
    values, attributes = node[()], node.attrs
    if np.asarray(values).dtype.kind not in "biuf":
        return values
    for key in {"_FillValue", "missing_value"} & attributes.keys():
        values = np.where(np.isin(values, attributes[key]), np.nan, values)
    ends = [attributes.get(key, math.nan) for key in ("valid_min", "valid_max")]
    low, high = np.ravel(attributes.get("valid_range", ends))
    if not np.isnan([low, high]).all():
        values = np.where((values < low) | (values > high), np.nan, values)
    if "scale_factor" in attributes and np.ndim(values) == 1 and len(values):
        values = np.where(missing_codes(values), np.nan, values)
    for key, change in (("scale_factor", np.multiply), ("add_offset", np.add)):
        if key in attributes:
            values = change(values, float(np.squeeze(attributes[key])))
    return values


def read_tdms(path: Path, content: FileColumns) -> None:
    """Add the channels of a TDMS file; as "group/channel" if a name occurs twice."""
    nptdms = optional_library("nptdms", "TDMS")
    with open(path, "rb") as file:  # which nptdms would leave open if it is damaged
        states = _states_of_channels(nptdms, _segments(file, path))
        table = nptdms.TdmsFile.open(file)
        channels = [channel for group in table.groups() for channel in group.channels()]
        names = [channel.name for channel in channels]
        starts = [states[channel.path][0][2].get("wf_start_time") for channel in channels]
        content.start = min((pd.Timestamp(start) for start in starts if start), default=None)
        for channel in channels:
            twice = names.count(channel.name) > 1
            name = f"{channel.group_name}/{channel.name}" if twice else channel.name
            add_array(content, name, channel[:])
            properties = channel.properties
            if name in content.columns and properties.get("wf_increment"):
                content.rates[name] = _roundest_rate(float(properties["wf_increment"]), digits=15)
            if unit := properties.get("unit_string") or properties.get("NI_UnitDescription"):
                content.units[name] = str(unit)
            axis, of_axis = (properties.get(key) for key in ("wf_xname", "wf_xunit_string"))
            if reason := _other_axis(axis, of_axis) or _difference(states[channel.path]):
                content.defects[name] = reason
            begin = {"wf_start_time": content.start or 0}
            content.starts[name] = _seconds_since(begin | states[channel.path][0][2], begin)


def _other_axis(name: Any, unit: Any) -> str:
    """Say that values are over something else than time in s, by the name and unit of their axis.

    Examples
    --------
    >>> _other_axis("Time", "s"), _other_axis("", "Hz")
    ('', 'is no signal over time in s, but over Hz')
    """
    name, unit = (re.sub("^NONE$", "", str(x or "").strip(), flags=re.I) for x in (name, unit))
    if unit.lower() in ("s", "sec", "seconds") or not (unit or (name and not is_time_name(name))):
        return ""
    return f"is no signal over time in s, but over {name} {unit}".replace("  ", " ").rstrip()


def _segments(file: BinaryIO, path: Path) -> list[bytes]:
    """Return the segments of a TDMS file without their samples, as they are in an index file."""
    size, end = path.stat().st_size, 0
    segments = []
    while end < size:
        file.seek(end)
        start = file.read(28)
        if not b"TDSm".startswith(start[:4]):  # a damaged file
            break
        start = start.ljust(28, b"\0")
        order: Literal["big", "little"] = "big" if start[4] & 64 else "little"
        length, n_before_samples = (int.from_bytes(start[at : at + 8], order) for at in (12, 20))
        if length == 2**64 - 1:  # of a segment that was being written
            text = "its last segment was not finished; the samples that are in it are read."
            warn("unfinished file", f"{printable(path)}: {text}")
            break
        segments.append(b"TDSh" + start[4:] + file.read(min(n_before_samples, size)))
        end += 28 + length
    _check_complete(path, end)
    file.seek(0)
    return segments


_State = tuple[int, int, dict[str, Any]]  # number of segments and of samples, properties


def _states_of_channels(nptdms: Any, segments: Sequence[bytes]) -> dict[str, list[_State]]:
    """Return what is known of each TDMS channel after some segments: all, or 30 of more than 100.

    A file has the properties of its last segment; those of the others are found by leaving out what
    follows them.
    """
    states: dict[str, list[_State]] = {}
    last = np.linspace(1, len(segments), len(segments) if len(segments) <= 100 else 30)
    for n in sorted({int(end) - before for end in last for before in (0, 1)} - {0}):
        table = nptdms.TdmsFile.read_metadata(BytesIO(b"".join(segments[:n])))
        for channel in (channel for group in table.groups() for channel in group.channels()):
            state = n, len(channel), dict(channel.properties)
            states.setdefault(channel.path, []).append(state)
    return states


def _difference(states: Sequence[_State]) -> str:
    """Say where TDMS segments do not follow each other at one rate, or have other units."""
    first = states[0][2]
    step = float(first.get("wf_increment") or 0)
    for (n_before, n_times, before), (n, _, now) in pairwise(states):
        late = _seconds_since(now, first) - n_times * step
        for key in ("wf_increment", "unit_string"):
            if key in first and now[key] != first[key]:
                return f"has segments with {key} = {first[key]} and {now[key]}. Save each as a file"
        is_next = n == n_before + 1 and step > 0 and _seconds_since(now, before) != 0
        if is_next and abs(late) > 1e-3 + 1.5 * step:
            text = f"has a segment that starts {late:.6g} s after the end of the one before, at "
            return f"{text}sample {n_times}. Save each as a file"
    return ""


def _seconds_since(now: Mapping[str, Any], first: Mapping[str, Any]) -> float:
    start, before = (pd.Timestamp(each.get("wf_start_time", 0)) for each in (now, first))
    late = now.get("wf_start_offset", 0.0) - first.get("wf_start_offset", 0.0)
    return (start - before).total_seconds() + late


def _check_complete(path: Path, stated: int) -> None:
    """Refuse a file that has fewer bytes than it states."""
    size = path.stat().st_size
    if size < stated:
        raise RefusedFileError(
            f"it is truncated: it states {stated} bytes, there are {size}. Copy it again."
        )


def read_uff(path: Path, content: FileColumns) -> None:
    """Add the data sets of type 58 over time; named by their first line."""
    pyuff = optional_library("pyuff", "UFF 58")
    marks = re.findall(rb"    -1(?= *[\r\n]| *$)", path.read_bytes())
    if len(marks) % 2:
        text = f"it ends within its data set {len(marks) // 2 + 1}; only those before are read"
        if len(marks) == 1:
            raise RefusedFileError("it ends within its first data set. Write it again.")
        warn("unfinished file", f"{printable(path)}: {text}.")
    sets = pyuff.UFF(str(path)).read_sets()
    sets = sets if isinstance(sets, list) else [sets]
    ids = {n: str(one.get("id1", "")).strip() for n, one in enumerate(sets) if one["type"] == 58}
    names = [f"x{n}" if name.upper() in ("", "NONE") else name for n, name in ids.items()]
    for name, one in zip(_distinct(names), [sets[n] for n in ids], strict=True):
        n_times = int(one.get("num_pts") or len(one["data"]))
        add_array(content, name, one["data"][:n_times])
        kind, of_function = one.get("abscissa_spec_data_type"), one.get("func_type", 1)
        label, unit = one.get("abscissa_axis_lab"), one.get("abscissa_axis_units_lab")
        if of_function not in (0, 1):
            label, unit = f"another quantity (type of function {of_function})", ""
        elif kind not in (None, 0, 1):  # unknown, or general
            label, unit = _ABSCISSAS.get(kind, f"a quantity {kind}"), unit if kind == 17 else ""
        if reason := _other_axis(label, unit):
            content.defects[name] = reason
        elif len(one["data"]) < n_times:
            content.defects[name] = f"has only {len(one['data'])} of {n_times} stated samples"
        step = float(one.get("abscissa_inc") or 0)
        times = np.asarray(one.get("x", ()), float)[:n_times]
        if one.get("abscissa_spacing") == 1 and step > 0:
            content.rates[name] = _roundest_rate(step, digits=6)
        elif len(times) > 1:
            content.times[name] = times - times[0]
        unit = str(one.get("ordinate_axis_units_lab", "")).strip()
        if unit.upper() not in ("", "NONE"):
            content.units[name] = unit
        content.starts[name] = float(one.get("abscissa_min") or 0)


def _distinct(names: Sequence[str]) -> list[str]:
    """Return names, of which those that occur several times are numbered.

    Examples
    --------
    >>> _distinct(["a", "b", "a"])
    ['a.0', 'b', 'a.1']
    """
    return [
        f"{name}.{names[:n].count(name)}" if names.count(name) > 1 else name
        for n, name in enumerate(names)
    ]


def read_mdf(path: Path, content: FileColumns) -> None:
    """Add the channels of an MDF 4 file, with their time stamps.

    Channels of one name are numbered, as "name.0".
    """
    asammdf = optional_library("asammdf", "MDF", extra="mdf")
    with asammdf.MDF(str(path)) as file:
        content.start = pd.Timestamp(file.start_time)
        groups = [group.channel_group for group in file.groups]
        check_stated_size(path, sum(group.cycles_nr * group.samples_byte_nr for group in groups))
        signals = list(file.iter_channels())
        for name, signal in zip(_distinct([s.name for s in signals]), signals, strict=True):
            if signal.samples.dtype.kind not in "biuf" or len(signal.samples) < 2:
                continue
            times = np.asarray(signal.timestamps, float)
            content.put(name, signal.samples)
            content.starts[name] = float(times[0])
            content.times[name] = times - times[0]
            if signal.unit:
                content.units[name] = str(signal.unit)
            invalid = signal.invalidation_bits
            if invalid is not None and np.any(invalid):
                first, last = np.flatnonzero(invalid)[[0, -1]]
                content.defects[name] = (
                    f"has {np.sum(invalid)} samples that the file marks as invalid, the first is "
                    f"sample {first}, the last {last}"
                )
            axis, kind = signal.master_metadata or ("time", 1)
            if kind not in (0, 1):  # none, time
                content.defects[name] = f"is no signal over time in s, but over {axis!r}"


def _roundest_rate(step: float, *, digits: int) -> float:
    """Return the roundest rate [Hz] with this time between samples [s], stored with some digits.

    Examples
    --------
    >>> _roundest_rate(8.33333e-05, digits=6), _roundest_rate(1 / 48_828.125, digits=15)
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
    for key in [key for key in _RATE_KEYS if key in attributes][:1]:
        rate = float(np.asarray(_decoded(attributes[key]), np.float64).item())
        if own:
            content.rates[place] = rate
        else:
            content.numbers[f"{place}{'fs' if key == 'rate' else key}"] = rate
    for key in [key for key in _UNIT_KEYS if key in attributes]:
        units = _decoded(attributes[key])
        if isinstance(units, str) and units.startswith("{"):
            units = json.loads(units)
        pairs = units.items() if isinstance(units, Mapping) else [("", units)]
        content.units |= {f"{place}{name}": str(unit) for name, unit in pairs}


def _decoded(value: Any) -> Any:
    return value.decode() if isinstance(value, bytes) else value
