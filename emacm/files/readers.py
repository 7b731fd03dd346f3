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
    if not path.is_file():
        raise ValueError("it is not a file, but a folder or a device. Name a file.")
    if not path.stat().st_size:
        raise ValueError("the file is empty (0 bytes). Record it again, or leave it out.")
    content = FileColumns()
    try:
        reader(path, content)
        content.take_units_from_groups()
        content.take_units_from_names()
        return content
    except (RefusedFileError, ImportError, FileNotFoundError, PermissionError):
        raise
    except Exception as error:
        raise ValueError(
            f"it cannot be read as a {path.suffix.lower()} file ({type(error).__name__}: {error}). "
            f"It is damaged, incomplete or of another type. Copy it again, or leave it out."
        ) from error
