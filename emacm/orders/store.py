"""Spectra that are kept between calls, folds and searches, and in a folder between processes.

In a folder, the key of a spectrum is the content of its recording and all settings. It is kept by
`joblib.Memory`, which estimates a damaged one again.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import partial
from hashlib import sha256
from typing import Any

import joblib
import numpy as np
from numpy.typing import NDArray
from sklearn.utils.validation import check_memory

from emacm._version import __version__
from emacm.orders.segment_plan import SegmentPlan
from emacm.recordings.digests import Recent, content_digest
from emacm.recordings.inputs import run
from emacm.resampling.angle_recording import AngleRecording

Spectrum = NDArray[np.floating]
_recent: Recent[Spectrum] = Recent(1 << 28)  # of this process


def open_memory(memory: Any) -> joblib.Memory:
    """Return the joblib.Memory for the parameter `memory` of an estimator.

    Parameters
    ----------
    memory : None, str, path or joblib.Memory
        A folder.

    Returns
    -------
    joblib.Memory
        That keeps nothing for None.

    Raises
    ------
    ValueError
        If it is none of these, or the folder cannot be made.
    """
    if not isinstance(memory, str | os.PathLike):
        return check_memory(memory)
    try:
        # Compressed with a checksum, so that damage is noticed.
        return joblib.Memory(os.fspath(memory), verbose=0, compress=1)
    except OSError as error:
        raise ValueError(
            f"memory = {os.fspath(memory)!r} cannot be used as a folder of spectra: {error}. "
            f"Choose a folder with write permission."
        ) from error


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
    recall = None
    if memory is not None and memory is not False:
        recall = open_memory(memory).cache(_estimated, ignore=["row", "plan"])
    return run(partial(_spectrum, plan, settings, recall, memory is not False), rows, **options)


def _spectrum(plan: SegmentPlan, settings: str, recall: Any, keep: bool, row: Any) -> Spectrum:
    """Return the spectrum of a row: of this process, of the folder, or estimated."""
    if not keep or (recall is None and not isinstance(row, AngleRecording)):
        return plan.spectra_of(row)
    known = None
    if isinstance(row, AngleRecording):
        known = row.measured.identity, settings, repr(list(row.settings))
        found = _recent.get(known)
        if found is not None:
            return found
    if recall is None:
        found = plan.spectra_of(row)
    else:
        found = recall(spectrum_key(row, settings), row=row, plan=plan)
    if known is not None:
        _recent.put(known, found, found.nbytes)
    return found


def _estimated(key: str, row: Any, plan: SegmentPlan) -> Spectrum:
    """Estimate a spectrum, which joblib keeps under its key."""
    return plan.spectra_of(row)
