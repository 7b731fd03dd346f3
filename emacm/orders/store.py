"""Spectra that are kept in a folder between calls, folds, searches and processes.

The key of a spectrum is the content of its recording and all settings. It is kept by
`joblib.Memory`, which estimates a damaged one again.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import partial
from hashlib import sha256
from typing import Any

import joblib
import numpy as np
from numpy.typing import NDArray
from sklearn.utils.validation import check_memory

from emacm._version import __version__
from emacm.orders.segment_plan import SegmentPlan
from emacm.recordings.digests import content_digest
from emacm.recordings.inputs import run
from emacm.resampling.angle_recording import AngleRecording

Spectrum = NDArray[np.floating]


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


def recalled(
    estimate: Callable[[Any], Spectrum],
    rows: Sequence[Any],
    memory: Any,
    plan: SegmentPlan,
    **options: Any,
) -> list[Spectrum]:
    """Return the spectrum of each row, and estimate those that are not kept.

    Parameters
    ----------
    estimate : callable
        Returns the spectrum of a row.
    rows : sequence of AngleRecording or ndarray
        Recordings or signals over shaft angle.
    memory : str, path or joblib.Memory
        Where spectra are kept.
    plan : SegmentPlan
        What the spectra depend on besides the rows.
    **options
        See `emacm.recordings.inputs.run`.

    Returns
    -------
    list of ndarray
    """
    recall = open_memory(memory).cache(_estimated, ignore=["row", "estimate"])
    settings = joblib.hash((vars(plan), __version__))
    keys = [spectrum_key(row, settings) for row in rows]
    return run(partial(recall, estimate=estimate), keys, rows, **options)


def _estimated(key: str, row: Any, estimate: Callable[[Any], Spectrum]) -> Spectrum:
    """Estimate a spectrum, which joblib keeps under its key."""
    return estimate(row)
