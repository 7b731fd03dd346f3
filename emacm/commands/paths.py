"""Files that are named on the command line, and those in folders."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from emacm.recordings.files import recording_files


def expanded(paths: Sequence[Path]) -> list[Path]:
    """Return files, and in place of folders the files in them, sorted."""
    found: list[Path] = []
    for path in paths:
        found += sorted(recording_files(path)) if path.is_dir() else [path]
    return list(dict.fromkeys(found))


def check_paths(paths: Sequence[Path]) -> None:
    """Raise a ValueError if a folder has no file of a known type."""
    for path in paths:
        if path.is_dir() and next(recording_files(path), None) is None:
            raise ValueError(f"the folder {str(path)!r} has no file of a known type.")
