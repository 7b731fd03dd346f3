"""Readers of files, by the suffix of their names; those of npz and WAV files."""

from __future__ import annotations

import importlib
import io
import math
import os
import zipfile
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from emacm.recordings.file_columns import FileColumns
from emacm.recordings.file_kinds import check_file, other_kind

_NPY = b"\x93NUMPY"  # start of an array in an npz file
_PASSED_ON = (ImportError, MemoryError, FileNotFoundError)
_DAMAGED = " It is damaged, incomplete or of another type. Copy it again, or leave it out."
_OTHERS = {"U": "texts", "S": "texts", "O": "objects", "m": "differences of times"}
_MOST_COLUMNS = 10_000


class RefusedFileError(ValueError):
    """A file that is read correctly, but holds nothing that can be used."""


def read_columns(path: Path) -> FileColumns:
    """Read a file.

    Parameters
    ----------
    path : Path
        The file; its suffix tells its type.

    Returns
    -------
    FileColumns

    Raises
    ------
    FileNotFoundError, PermissionError
        If it cannot be opened.
    ImportError
        If the library for its type is not installed; the message names the extra.
    ValueError
        If its type is not known, or it is empty, damaged or of another type.
    """
    reader = _reader_of(path)
    check_file(path)
    try:
        return reader(path)
    except PermissionError as error:
        raise PermissionError(
            f"{str(path)!r}: there is no permission to read it. Ask for it, or leave the file out."
        ) from error
    except RefusedFileError as error:
        raise RefusedFileError(f"{error}{other_kind(path)}") from error
    except _PASSED_ON:
        raise
    except Exception as error:
        raise ValueError(
            f"it cannot be read as a {path.suffix.lower()} file ({type(error).__name__}: {error})."
            f"{other_kind(path) or _DAMAGED}"
        ) from error


def optional_library(name: str, kind: str, extra: str = "files") -> Any:
    """Import the library that reads a type of file, or name the extra that installs it."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        library = name.partition(".")[0]
        raise ImportError(
            f"{kind} files are read by {library}, which is not installed; run "
            f"pip install 'emacm[{extra}]'."
        ) from error


def array_columns(name: str, values: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the columns of an array: itself, or of two dimensions, those along the shorter one.

    Examples
    --------
    >>> [name for name, _ in array_columns("vibration", np.zeros((2, 500)))]
    ['vibration.0', 'vibration.1']
    """
    array = np.squeeze(np.asarray(values))
    if array.ndim == 1:
        yield name, array
    elif array.ndim == 2:
        rows = array if array.shape[0] <= array.shape[1] else array.T
        yield from ((f"{name}.{number}", row) for number, row in enumerate(rows))


def add_array(content: FileColumns, name: str, values: Any) -> None:
    """Add a numeric array to the content of a file, its fields, or a single number.

    What is not added is noted with the reason.
    """
    array = np.asarray(values)
    if array.dtype.names:
        for field in array.dtype.names:
            add_array(content, f"{name}.{field}", array[field])
    elif not array.size:
        content.ignored[name] = "is empty"
    elif array.dtype.kind == "M" and array.ndim == 1:
        content.columns[name] = array
    elif array.dtype.kind not in "biufc":
        content.ignored[name] = f"holds {_OTHERS.get(array.dtype.kind, 'no numbers')}"
    elif array.size == 1 and array.dtype.kind != "c":
        content.numbers[name] = float(array.reshape(()))
    elif np.squeeze(array).ndim > 2:
        content.ignored[name] = f"has {array.ndim} dimensions {array.shape}"
    else:
        content.columns.update(array_columns(name, array))


def _read_npz(path: Path) -> FileColumns:
    content = FileColumns({})
    with open(path, "rb") as file:
        if file.read(2) != b"PK":
            raise RefusedFileError(
                "it is not an .npz file (no ZIP archive). Save it by numpy.savez."
            )
        with zipfile.ZipFile(file) as archive:
            for member in archive.namelist():
                data = archive.read(member)
                if data.startswith(_NPY):
                    name = member.removesuffix(".npy")
                    add_array(content, name, _array_of(data, name))
    return settled(content)


def _array_of(data: bytes, name: str) -> NDArray[Any]:
    """Return an array as `numpy.load` does, but without a copy of the samples."""
    length = len(_NPY) + 4 + int.from_bytes(data[len(_NPY) + 2 : len(_NPY) + 4], "little")
    if data[len(_NPY) :][:2] != b"\x01\x00":  # a header of another version
        length = 0
    shape, is_fortran, dtype = _array_header(data[:length]) if length else ((), False, None)
    if dtype is None or dtype.hasobject:
        try:
            return np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
        except ValueError as error:
            if "allow_pickle" not in str(error):
                raise
            raise RefusedFileError(
                f"array {name!r} holds Python objects (a pickle), which are not opened. Save "
                f"numbers."
            ) from error
    if min(shape, default=0) < 0:
        raise ValueError(f"array {name!r} has the shape {shape}")
    values = np.frombuffer(data, dtype, count=math.prod(shape), offset=length)
    return values.reshape(shape, order="F" if is_fortran else "C")


@lru_cache(maxsize=256)
def _array_header(header: bytes) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return shape, order and type; files of one kind have the same headers."""
    file = io.BytesIO(header[len(_NPY) + 2 :])
    return np.lib.format.read_array_header_1_0(file)


def settled(content: FileColumns) -> FileColumns:
    """Return content with units taken out of the names."""
    if len(content.columns) > _MOST_COLUMNS:
        raise RefusedFileError(
            f"it has {len(content.columns)} columns; at most {_MOST_COLUMNS} are read. Store a "
            f"column for each channel, with a row for each time."
        )
    parts = content.columns, content.rates, content.units, content.numbers, content.ignored
    return FileColumns(*parts)


def _read_wav(path: Path) -> FileColumns:
    with open(path, "rb") as file:
        header = file.read(12)
    if header[:4] not in (b"RIFF", b"RF64") or header[8:] != b"WAVE":
        raise RefusedFileError("it is not a WAV file (no RIFF header).")
    stated, size = int.from_bytes(header[4:8], "little") + 8, os.stat(path).st_size
    if header[:4] == b"RIFF" and stated > size + 1:  # a padding byte may be missing
        raise RefusedFileError(
            f"it is truncated: its header states {stated} bytes, there are {size}. Copy it again."
        )
    fs, samples = scipy.io.wavfile.read(path)
    if samples.dtype.kind in "iu":  # full scale is 1
        bits = 8 * samples.dtype.itemsize
        middle = 128 if samples.dtype == np.uint8 else 0
        samples = (samples.astype(np.float64) - middle) / 2.0 ** (bits - 1)
    table = samples.reshape(len(samples), -1)
    columns = {f"x{i}": np.ascontiguousarray(row) for i, row in enumerate(table.T)}
    return FileColumns(columns, dict.fromkeys(columns, float(fs)))


def _read_later(module: str, name: str) -> Callable[[Path], FileColumns]:
    """Return a reader of another module, which is imported when it is used."""

    def read(path: Path) -> FileColumns:
        return getattr(importlib.import_module(f"emacm.recordings.{module}"), name)(path)

    return read


READERS: dict[str, Callable[[Path], FileColumns]] = {
    ".npz": _read_npz,
    ".csv": _read_later("csv_files", "read_csv"),
    ".txt": _read_later("csv_files", "read_csv"),
    ".tsv": _read_later("csv_files", "read_csv"),
    ".wav": _read_wav,
    ".mat": _read_later("matlab_files", "read_mat"),
    ".parquet": _read_later("measurement_files", "read_parquet"),
    ".h5": _read_later("measurement_files", "read_hdf5"),
    ".hdf5": _read_later("measurement_files", "read_hdf5"),
    ".tdms": _read_later("measurement_files", "read_tdms"),
    ".uff": _read_later("measurement_files", "read_uff"),
    ".unv": _read_later("measurement_files", "read_uff"),
    ".mf4": _read_later("measurement_files", "read_mdf"),
}


def _reader_of(path: Path) -> Callable[[Path], FileColumns]:
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        kind = f"of type {path.suffix}" if path.suffix else "without a suffix"
        raise ValueError(
            f"files {kind} are not read; known are {sorted(READERS)}. Convert it, or leave it out."
        )
    return reader
