"""Spectra that are kept between calls, folds and searches, and in a folder between processes.

In a folder, the name of a spectrum is a digest of the content of its recording and of all settings.
Behind the array in the format of NumPy is a checksum, so that a damaged one is estimated again.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any
from zlib import crc32

import joblib
import numpy as np
from numpy.typing import NDArray

from emacm._saved import write_whole
from emacm._statements import warn
from emacm._version import __version__
from emacm.orders.segment_plan import SegmentPlan
from emacm.recordings.digests import Recent, content_digest
from emacm.recordings.inputs import run
from emacm.resampling.angle_recording import AngleRecording

Spectrum = NDArray[np.floating]
_recent: Recent[Spectrum] = Recent(1 << 28)  # of this process


def folder_of(memory: Any) -> Path:
    """Return the folder of spectra for the parameter `memory` of an estimator, and make it.

    Parameters
    ----------
    memory : str or path
        The folder in which it is.

    Raises
    ------
    ValueError
        If it cannot be made.
    """
    try:
        folder = Path(memory) / "emacm_spectra"
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, TypeError) as error:
        raise ValueError(
            f"memory = {str(memory)!r} cannot be used as a folder of spectra: {error}. "
            f"Choose a folder with write permission."
        ) from error
    return folder


def spectrum_key(row: Any, settings: str) -> str:
    """Return the key of the spectrum of a row.

    Parameters
    ----------
    row : AngleRecording or ndarray
        A recording or a signal over shaft angle. Its content counts, and how it is resampled.
    settings : str
        All else that the spectrum depends on, as text.

    Returns
    -------
    str
        64 hexadecimal digits.
    """
    if isinstance(row, AngleRecording):
        content = row.measured.digest
        settings += repr(list(row.settings))
    else:
        content = content_digest("row", [row])
    return sha256(f"{content}{settings}".encode("utf-8", "surrogatepass")).hexdigest()


def spectra_of_rows(
    rows: Sequence[Any], plan: SegmentPlan, memory: Any, **options: Any
) -> list[Spectrum]:
    """Return the spectrum of each row, and estimate those that are not kept.

    Parameters
    ----------
    rows : sequence of AngleRecording or ndarray
        Recordings or signals over shaft angle.
    plan : SegmentPlan
        What the spectra depend on besides the rows.
    memory : None, False, str, path or joblib.Memory
        Where spectra are kept, as for `OrderPSD`.
    **options
        See `emacm.recordings.inputs.run`.

    Returns
    -------
    list of ndarray
    """
    settings = joblib.hash((vars(plan), __version__))
    memory = getattr(memory, "location", memory)  # of a joblib.Memory
    folder = None if memory is None or memory is False else folder_of(memory)
    return run(partial(_spectrum, plan, settings, folder, memory is not False), rows, **options)


def _spectrum(
    plan: SegmentPlan, settings: str, folder: Path | None, keep: bool, row: Any
) -> Spectrum:
    """Return the spectrum of a row: of this process, of the folder, or estimated."""
    known = None
    if keep and isinstance(row, AngleRecording):
        known = row.measured.identity, settings, repr(list(row.settings))
        found = _recent.get(known)
        if found is not None:
            return found
    found = plan.spectra_of(row) if folder is None else _from_folder(folder, plan, settings, row)
    if known is not None:
        _recent.put(known, found, found.nbytes)
    return found


def _from_folder(folder: Path, plan: SegmentPlan, settings: str, row: Any) -> Spectrum:
    """Return the spectrum that a file holds; without one, or if it is damaged, estimate it."""
    path = folder / f"{spectrum_key(row, settings)}.npy"
    content = path.read_bytes() if path.is_file() else b""
    if content[-4:] == crc32(content[:-4]).to_bytes(4):
        return np.asarray(np.load(BytesIO(content)))
    found = plan.spectra_of(row)
    file = BytesIO()
    np.save(file, found)
    try:
        write_whole(path, file.getvalue() + crc32(file.getvalue()).to_bytes(4))
    except OSError as error:  # as of a full disk
        warn("not kept", f"a spectrum is not kept in the folder of memory: {error}")
    return found
