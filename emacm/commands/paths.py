"""The files that a command is to read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from emacm.files.folder import recording_files
from emacm.files.layout import Layout


def expanded(
    paths: Sequence[Path],
    layout: Layout | None = None,
    pattern: str = "**/*",
    *,
    may_be_empty: bool = False,
) -> list[Path]:
    """Return files, and in place of folders the files in them that match a pattern, sorted.

    Second files, from which a layout takes the motion of the shaft, are left out.

    Raises
    ------
    ValueError
        If a folder has no such file of a known type, unless it `may_be_empty`.
    """
    found: list[Path] = []
    for path in paths:
        files = recording_files(path, pattern, layout) if path.is_dir() else [path]
        if not files and not may_be_empty:
            raise ValueError(
                f"the folder {str(path)!r} has no file of a known type that matches {pattern!r}. "
                f"State other files, or another --pattern."
            )
        found += files
    return list(dict.fromkeys(found))
