"""The folder of a report: written whole, or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

REPORT = "report.html"
PARTS = (REPORT, "summary.json", "tables", "figures")  # files and folders of a report


def check_target(out: Path, *, overwrite: bool = False) -> None:
    """Check that a report may be written to a folder.

    Parameters
    ----------
    out : Path
        The folder; it need not exist.
    overwrite : bool
        Whether an existing report may be replaced.

    Raises
    ------
    OSError
        If it is not a folder.
    ValueError
        If it contains a report and `overwrite` is False, or other files with the names of a report.
    """
    if out.exists() and not out.is_dir():
        raise OSError(f"cannot write to the folder {out}: it is a file.")
    taken = [part for part in PARTS if (out / part).exists()]
    if REPORT in taken and not overwrite:
        raise ValueError(
            f"the folder {out} already contains a report. Pass --overwrite to replace it, or --out "
            f"with another folder."
        )
    if taken and REPORT not in taken:
        raise ValueError(
            f"the folder {out} contains {', '.join(taken)}, but no report of emacm. Pass --out "
            f"with another folder, so that nothing is lost."
        )


@contextmanager
def whole_folder(out: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary folder, and move the complete report from it to its place.

    After an error or an interruption nothing is left behind, and an existing report is unchanged.

    Parameters
    ----------
    out : Path
        Folder of the report. Other files in it are not changed.
    overwrite : bool
        Whether an existing report may be replaced.

    Yields
    ------
    Path
        The temporary folder, in `out` or in the nearest existing folder above it.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    ValueError
        As for `check_target`.
    """
    out = Path(out).absolute()
    check_target(out, overwrite=overwrite)
    existing = next(folder for folder in (out, *out.parents) if folder.exists())
    work = existing / f".emacm-{uuid4().hex}"
    try:  # from before the folder is made, as an interruption may come at any time
        try:
            work.mkdir(0o700)
        except OSError as error:
            raise OSError(f"cannot write to the folder {out}: {error.strerror}.") from error
        new, old = work / "new", work / "old"
        new.mkdir()  # with the default permissions of folders; those of `work` are narrower
        old.mkdir()
        yield new
        missing = [part for part in PARTS if not (new / part).exists()]
        if missing:
            raise FileNotFoundError(f"the report is incomplete: {', '.join(missing)}")
        out.mkdir(parents=True, exist_ok=True)
        check_target(out, overwrite=overwrite)
        for part in PARTS:
            if (out / part).exists():
                (out / part).rename(old / part)
        for part in PARTS:
            (new / part).rename(out / part)
    finally:
        shutil.rmtree(work, ignore_errors=True)
