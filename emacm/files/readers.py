"""Readers of files, by the suffix of their names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from emacm.files import measurement_files as of_arrays
from emacm.files.csv_files import read_csv
from emacm.files.file_columns import FileColumns, RefusedFileError

READERS: dict[str, Callable[[Path, FileColumns], None]] = {
    ".npz": of_arrays.read_npz,
    ".csv": read_csv,
    ".txt": read_csv,
    ".tsv": read_csv,
    ".wav": of_arrays.read_wav,
    ".mat": of_arrays.read_mat,
    ".parquet": of_arrays.read_parquet,
    ".h5": of_arrays.read_hdf5,
    ".hdf5": of_arrays.read_hdf5,
    ".tdms": of_arrays.read_tdms,
    ".uff": of_arrays.read_uff,
    ".unv": of_arrays.read_uff,
    ".mf4": of_arrays.read_mdf,
}
_KINDS: tuple[tuple[bytes, str, tuple[str, ...]], ...] = (  # first bytes, what it is, suffixes
    (b"\x1f\x8b", "compressed by gzip: unpack it", ()),
    (b"PK\x03\x04", "a ZIP archive, such as an Excel workbook: save it as CSV", (".npz",)),
    (b"<!DOCTYPE", "a web page: download the file again", ()),
    (b"<html", "a web page: download the file again", ()),
    (b"version https://git-lfs", "a pointer of Git LFS: run git lfs pull", ()),
)


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
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise ValueError(
            f"files of type {path.suffix!r} are not read; known are {sorted(READERS)}. Convert it."
        )
    size = path.stat().st_size
    if not path.is_file():
        raise ValueError("it is not a file, but a folder or a device. Name a file.")
    if not size:
        raise ValueError("the file is empty (0 bytes). Record it again, or leave it out.")
    if reader is read_csv and _other_kind(path):
        raise RefusedFileError(f"it is no text with rows of numbers.{_other_kind(path)}")
    content = FileColumns()
    try:
        reader(path, content)
        content.take_units_from_groups()
        content.take_units_from_names()
        return content
    except RefusedFileError as error:
        raise RefusedFileError(f"{error}{_other_kind(path)}") from error
    except (ImportError, FileNotFoundError, PermissionError):
        raise
    except Exception as error:
        damaged = " It is damaged, incomplete or of another type. Copy it again, or leave it out."
        raise ValueError(
            f"it cannot be read as a {path.suffix.lower()} file ({type(error).__name__}: {error})."
            f"{_other_kind(path) or damaged}"
        ) from error


def _other_kind(path: Path) -> str:
    """Return a sentence on what a file is that cannot be read as its suffix says; "" if unknown."""
    with open(path, "rb") as file:
        start = file.read(64).removeprefix(b"\xef\xbb\xbf").lstrip()
    for first, what, suffixes in _KINDS:
        if start.startswith(first) and path.suffix.lower() not in suffixes:
            return f" Its first bytes are those of another kind of file: it is {what}."
    return ""
