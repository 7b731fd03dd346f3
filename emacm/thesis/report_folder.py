"""A folder that holds a whole report or none."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

REPORT = "report.html"
PARTS = (REPORT, "summary.json", "tables", "figures")  # what a report is made of


def check_target(out: Path, *, overwrite: bool = False) -> None:
    """Refuse a folder that a report must not go to.

    Parameters
    ----------
    out : Path
        The folder; need not exist.
    overwrite : bool
        Whether a report that lies there may be replaced.

    Raises
    ------
    OSError
        If it is no folder.
    ValueError
        If it holds a report and `overwrite` is False, or files of another kind in a report's place.
    """
    if out.exists() and not out.is_dir():
        raise OSError(f"cannot write to the folder {out}: it is a file.")
    taken = [part for part in PARTS if (out / part).exists()]
    if REPORT in taken and not overwrite:
        raise ValueError(
            f"the folder {out} already holds a report. Pass --overwrite to replace it, or --out "
            f"with another folder."
        )
    if taken and REPORT not in taken:
        raise ValueError(
            f"the folder {out} holds {', '.join(taken)}, but no report of emacm. Pass --out with "
            f"another folder, so that nothing is lost."
        )


@contextmanager
def whole_folder(out: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Give a temporary folder to write to, and move it to its place when all is written.

    If anything goes wrong on the way, nothing is left behind, and what was there stays.

    Parameters
    ----------
    out : Path
        Where the report is to be. Other files in it are left alone.
    overwrite : bool
        Whether a report that lies there may be replaced.

    Yields
    ------
    Path
        The temporary folder, beside `out`, or in it if it exists.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    ValueError
        As for `check_target`.
    """
    out = Path(out).absolute()
    check_target(out, overwrite=overwrite)
    try:
        work = Path(tempfile.mkdtemp(prefix=".emacm-", dir=_nearest_folder(out)))
    except OSError as error:
        raise OSError(f"cannot write to the folder {out}: {error.strerror}.") from error
    try:
        new, old = work / "new", work / "old"
        new.mkdir()  # with the rights that folders have here; those of `work` are narrower
        old.mkdir()
        yield new
        if out.exists():
            check_target(out, overwrite=overwrite)
            _exchange(new, out, old)
        else:
            out.parent.mkdir(parents=True, exist_ok=True)
            new.rename(out)
    finally:
        shutil.rmtree(work, ignore_errors=True)


def _nearest_folder(out: Path) -> Path:
    """Return the folder itself, or the nearest one above it that exists."""
    return next(folder for folder in (out, *out.parents) if folder.exists())


def _exchange(new: Path, out: Path, old: Path) -> None:
    """Move the parts of a report into a folder, and those that lie there out of it."""
    try:
        for part in PARTS:
            if (out / part).exists():
                (out / part).rename(old / part)
        for part in PARTS:
            (new / part).rename(out / part)
    except BaseException:
        for part in PARTS:
            if (old / part).exists():
                if (out / part).exists():
                    (out / part).rename(new / part)
                (old / part).rename(out / part)
        raise
