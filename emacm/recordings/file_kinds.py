"""What a file is, by its state on the disk and by its first bytes, for messages."""

from __future__ import annotations

import os
import stat
from pathlib import Path

_NO_FILE = "Name a file of measurements."
_POINTER = b"version https://git-lfs"
_LONGEST_POINTER = 1024  # bytes
_KINDS: tuple[tuple[bytes, str, tuple[str, ...]], ...] = (  # first bytes, what it is, suffixes
    (b"\x1f\x8b", "compressed by gzip: unpack it", ()),
    (b"PK\x03\x04", "a ZIP archive, such as an Excel workbook: save it as CSV", (".npz",)),
    (b"\xd0\xcf\x11\xe0", "an Excel workbook: save it as CSV", ()),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file: name it .h5, or .mat", (".mat", ".h5", ".hdf5")),
    (b"RIFF", "a WAV file: name it .wav", (".wav",)),
    (b"MATLAB 5.0", "a MAT file: name it .mat", (".mat",)),
    (b"PAR1", "a Parquet file: name it .parquet", (".parquet",)),
    (b"TDSm", "a TDMS file: name it .tdms", (".tdms",)),
    (b"MDF ", "an MDF file: name it .mf4", (".mf4",)),
    (b"<!DOCTYPE", "a web page: download the file again", ()),
    (b"<html", "a web page: download the file again", ()),
    (b"%PDF", "a PDF document", ()),
)


def check_file(path: Path) -> None:
    """Raise a ValueError if there is nothing in a file that could be read.

    Parameters
    ----------
    path : Path
        A folder, a pipe, an empty file and a pointer of Git LFS are refused.

    Raises
    ------
    OSError
        If it cannot be opened.
    ValueError
        The message states what it is.
    """
    status = os.stat(path)
    if stat.S_ISDIR(status.st_mode):
        raise ValueError(f"it is a folder, not a file. {_NO_FILE}")
    if not stat.S_ISREG(status.st_mode):
        raise ValueError(f"it is no file on a disk, but a pipe or a device. {_NO_FILE}")
    if not status.st_size:
        raise ValueError("the file is empty (0 bytes). Record it again, or leave it out.")
    if status.st_size < _LONGEST_POINTER and _start(path).startswith(_POINTER):
        raise ValueError("it is a pointer of Git LFS, without the content. Run git lfs pull.")


def other_kind(path: Path) -> str:
    """Return a sentence on what a file is that cannot be read as its suffix says; "" if unknown."""
    start = _start(path).removeprefix(b"\xef\xbb\xbf").lstrip()
    for first, what, suffixes in _KINDS:
        if start.startswith(first) and path.suffix.lower() not in suffixes:
            return f" Its first bytes are those of another kind of file: it is {what}."
    return ""


def _start(path: Path) -> bytes:
    with open(path, "rb") as file:
        return file.read(64)
