"""Spectra of many recordings, of which only those are estimated that are not kept."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import partial
from hashlib import sha256
from typing import Any

import joblib
import numpy as np
from joblib import delayed
from numpy.typing import NDArray

from emacm._progress import run
from emacm.orders.store import SpectrumStore
from emacm.recordings.digests import content_digest
from emacm.resampling.angle_recording import AngleRecording

_PATIENCE = 60.0  # s; how long to wait for a spectrum that somebody else has in work


def spectrum_key(row: Any, settings: str) -> str:
    """Return the key of the spectrum of a row under settings.

    Parameters
    ----------
    row : AngleRecording or ndarray
        What the spectrum is of. Its content counts, and how it is resampled.
    settings : str
        All else that the spectrum depends on, as text.

    Returns
    -------
    str
        64 hexadecimal digits.
    """
    if isinstance(row, AngleRecording):
        names = [field.name for field in fields(row) if field.name != "measured"]
        content = row.measured.digest
        settings += repr([(name, getattr(row, name)) for name in names])
    else:
        content = content_digest("row", [row])
    return sha256(f"{content}{settings}".encode("utf-8", "surrogatepass")).hexdigest()


def recalled_spectra(
    estimate: Callable[[Any, int], NDArray[np.floating]],
    rows: Sequence[Any],
    store: SpectrumStore | None,
    settings: Mapping[str, Any],
    *,
    n_jobs: int | None = None,
    verbose: bool | int = False,
) -> list[NDArray[np.floating]]:
    """Return the spectrum of each row, estimating those that are not kept.

    Each is estimated once, also if several threads or processes want it at the
    same time: what others have in work is left for later, and then waited for.

    Parameters
    ----------
    estimate : callable
        Given a row and its number, returns its spectrum.
    rows : sequence of AngleRecording or ndarray
        What spectra are wanted of.
    store : SpectrumStore or None
        Where they are kept. None: nothing is, and each row is estimated.
    settings : mapping of str to object
        What the spectra depend on besides the rows.
    n_jobs, verbose : int
        See `emacm._progress.run`.

    Returns
    -------
    list of ndarray
        Some of them read-only.
    """
    if store is None:
        tasks = (delayed(estimate)(row, index) for index, row in enumerate(rows))
        return run(tasks, len(rows), n_jobs=n_jobs, verbose=verbose)
    key_of = partial(spectrum_key, settings=joblib.hash(_plain(settings)))
    keys = [key_of(row) for row in rows]
    first: dict[str, int] = {}
    for index, key in enumerate(keys):
        first.setdefault(key, index)
    found: dict[str, Any] = {key: store.find(key) for key in first}
    for patience in (0.0, _PATIENCE):
        missing = [key for key, spectrum in found.items() if spectrum is None]
        tasks = (
            delayed(_recalled)(estimate, rows[first[key]], first[key], store, key_of, patience)
            for key in missing
        )
        done = len(found) - len(missing)
        results = run(tasks, len(missing), n_jobs=n_jobs, verbose=verbose, done=done)
        found.update(zip(missing, results, strict=True))
    return [found[key] for key in keys]


def _plain(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings with dataclasses as fields, without what these may remember."""
    return {
        name: {field.name: getattr(value, field.name) for field in fields(value)}
        if is_dataclass(value)
        else value
        for name, value in settings.items()
    }


def _recalled(
    estimate: Callable[[Any, int], NDArray[np.floating]],
    row: Any,
    index: int,
    store: SpectrumStore,
    key_of: Callable[[Any], str],
    patience: float,
) -> NDArray[np.floating] | None:
    """Find or estimate a spectrum; None if others have it in work and there is no patience."""
    key = key_of(row)
    with store.claimed(key, patience) as mine:
        if not mine and not patience:
            return None
        spectrum = store.find(key)  # others may have made it since
        if spectrum is None:
            spectrum = estimate(row, index)
            if key_of(row) == key:  # or its file was written while it was read
                store.keep(key, spectrum)
        return spectrum
