"""Spectra that are kept between calls: in memory, and in files that processes share.

The key of a spectrum is the content of its recording and all settings. Files are npz: numbers only,
no pickled code, with a checksum. Each is written under a temporary name and then renamed; whatever
cannot be read, or is not a spectrum of the expected shape, is estimated again.

`joblib.Memory` is not used: it deletes foreign files in the same folder, and it accepts a damaged
file that can still be read.
"""

from __future__ import annotations

import os
import uuid
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import fields
from functools import partial
from hashlib import sha256
from pathlib import Path
from threading import get_ident
from typing import Any

import joblib
import numpy as np
from joblib.parallel import get_active_backend
from numpy.typing import NDArray
from sklearn.utils.validation import check_memory

from emacm._checks import check_count
from emacm._progress import run
from emacm._version import __version__
from emacm.orders.segment_plan import SegmentPlan
from emacm.recordings.digests import Recent, content_digest
from emacm.resampling.angle_recording import AngleRecording

NUMERICS = 5  # incremented whenever the numbers of a spectrum change; part of every key

Spectrum = NDArray[np.floating]

_recent: Recent[Spectrum] = Recent(1 << 28)  # bytes; of all stores of this process
_written: dict[str, float] = {}  # bytes this process wrote to a folder since it checked its size


class SpectrumStore:
    """A folder of spectra of limited size; spectra used in this process are also kept in memory.

    `OrderPSD` accepts one as its `memory`, in place of a folder. Several processes and threads may
    use the same folder at the same time; two of them may estimate the same spectrum. Where the
    limit is exceeded, the oldest files are deleted. To start again, delete the folder (and call
    `clear_memory` in processes that continue).

    Parameters
    ----------
    folder : str or path
        The files are written to its subdirectory ``emacm_spectra``.
    bytes_limit : int
        Size of all files [bytes], checked whenever a twentieth of it was written. Default: 1 GiB.
        In memory, all stores of a process hold at most 256 MiB together.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from emacm.orders.store import SpectrumStore
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     store = SpectrumStore(folder)
    ...     store.keep("a" * 64, np.ones((1, 3)))
    ...     print(store.find("a" * 64, (1, 3)), store.find("b" * 64, (1, 3)))
    [[1. 1. 1.]] None
    """

    def __init__(self, folder: str | os.PathLike[str], *, bytes_limit: int = 1 << 30) -> None:
        self.folder = os.path.abspath(os.fspath(folder))
        self.bytes_limit = check_count(bytes_limit, "bytes_limit")

    def made(self) -> SpectrumStore:
        """Make the folder, if it does not exist, and return the store."""
        try:
            os.makedirs(os.path.join(self.folder, "emacm_spectra"), exist_ok=True)
        except OSError as error:
            raise ValueError(
                f"memory = {self.folder!r} cannot be used as a folder of spectra: {error}. "
                f"Choose a folder with write permission."
            ) from error
        return self

    def find(self, key: str, shape: tuple[int, ...]) -> Spectrum | None:
        """Return the spectrum of a key, read-only, or None if there is none of this shape."""
        spectrum = _recent.get((self.folder, key))
        if spectrum is None:
            with suppress(Exception):  # which depends on what is damaged in the file
                # Opened here: of a damaged file, NumPy would leave it open.
                with self._file(key).open("rb") as file, np.load(file) as content:
                    values = content["spectrum"]
                if values.dtype == np.float64:
                    spectrum = values
                    self._remember(key, spectrum)
        return spectrum if spectrum is not None and spectrum.shape == shape else None

    def keep(self, key: str, spectrum: Spectrum) -> None:
        """Keep a spectrum under a key of 64 hexadecimal digits."""
        spectrum = np.array(spectrum, np.float64, order="C")
        self._remember(key, spectrum)
        final = self._file(key)
        unfinished = final.with_name(f"{key}.{uuid.uuid4().hex}.part")
        try:
            final.parent.mkdir(parents=True, exist_ok=True)
            with unfinished.open("wb") as file:
                np.savez(file, spectrum=spectrum)
            os.replace(unfinished, final)
            self._limit_size(spectrum.nbytes)
        except OSError as error:
            warnings.warn(
                f"spectra cannot be kept in {self.folder!r}: {error}. They will be estimated "
                f"again. Free space there, or set memory of OrderPSD to another folder.",
                RuntimeWarning,
                stacklevel=2,
            )

    def _file(self, key: str) -> Path:
        return Path(self.folder, "emacm_spectra", key[:2], f"{key}.npz")

    def _remember(self, key: str, spectrum: Spectrum) -> None:
        spectrum.flags.writeable = False  # it is shared by all callers
        _recent.put((self.folder, key), spectrum, spectrum.nbytes)

    def _limit_size(self, n_bytes: int) -> None:
        """Delete the oldest spectra where the limit is exceeded, and a tenth of the limit more."""
        _written[self.folder] = _written.get(self.folder, np.inf) + n_bytes
        if _written[self.folder] <= 0.05 * self.bytes_limit:
            return
        _written[self.folder] = 0.0
        files = []
        for pattern in ("*.npz", "*.part"):
            for file in Path(self.folder, "emacm_spectra").glob(f"[0-9a-f][0-9a-f]/{pattern}"):
                with suppress(OSError):  # deleted by another process
                    status = file.stat()
                    files.append((status.st_mtime_ns, status.st_size, file))
        excess = sum(size for _, size, _ in files) - self.bytes_limit
        if excess > 0:
            excess += self.bytes_limit // 10
        for _, size, file in sorted(files):
            if excess <= 0:
                break
            file.unlink(missing_ok=True)
            excess -= size


def clear_memory() -> None:
    """Release the spectra that this process holds in memory; files are kept."""
    _recent.clear()


def open_store(memory: Any) -> SpectrumStore | None:
    """Return the store for the parameter `memory` of an estimator.

    Parameters
    ----------
    memory : None, str, path, joblib.Memory or SpectrumStore
        A folder.

    Returns
    -------
    SpectrumStore or None

    Raises
    ------
    TypeError
        If it is of another type, or a joblib.Memory without a folder.
    ValueError
        If the folder cannot be made.
    """
    if isinstance(memory, SpectrumStore):
        return memory.made()
    if not isinstance(memory, str | os.PathLike | None):
        check_memory(memory)
        if not isinstance(memory, joblib.Memory) or memory.backend != "local":
            raise TypeError(
                f"memory must be None, a folder, a joblib.Memory on one, or a SpectrumStore, as "
                f"spectra are kept in files; got {memory!r}."
            )
        memory = memory.location
    return None if memory is None else SpectrumStore(memory).made()


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
        compared = [item.name for item in fields(row) if item.compare and item.name != "measured"]
        settings += repr([getattr(row, name) for name in compared])
    else:
        content = content_digest("row", [row])
    return sha256(f"{content}{settings}".encode("utf-8", "surrogatepass")).hexdigest()


def recalled(
    estimate: Callable[[Any], Spectrum],
    rows: Sequence[Any],
    store: SpectrumStore,
    plan: SegmentPlan,
    shape: tuple[int, ...],
    *,
    names: Sequence[Callable[[], str]] | None = None,
    n_jobs: int | None = None,
    verbose: bool | int = False,
) -> list[Spectrum]:
    """Return the spectrum of each row, and estimate those that are not in the store.

    Parameters
    ----------
    estimate : callable
        Returns the spectrum of a row.
    rows : sequence of AngleRecording or ndarray
        Recordings or signals over shaft angle.
    store : SpectrumStore
        Where spectra are kept.
    plan : SegmentPlan
        What the spectra depend on besides the rows.
    shape : tuple of int
        Shape of a spectrum.
    names, n_jobs, verbose
        See `emacm._progress.run`.

    Returns
    -------
    list of ndarray
        Some of them read-only.
    """
    known = {item.name: getattr(plan, item.name) for item in fields(plan)}
    if isinstance(plan.window, str):
        del known["weights"]  # which follow from the name and the length
    settings = joblib.hash((known, __version__, NUMERICS))
    keys = [spectrum_key(row, settings) for row in rows]
    first: dict[str, int] = {}
    for index, key in enumerate(keys):
        first.setdefault(key, index)
    found: dict[str, Any] = {key: store.find(key, shape) for key in first}
    missing = [key for key, spectrum in found.items() if spectrum is None]
    if get_active_backend()[0].nesting_level:
        # Workers of one search begin at different rows, and find what the others have estimated.
        worker = os.getpid(), get_ident()
        missing.sort(key=lambda key: hash((key, worker)))
    numbers = [first[key] for key in missing]
    names = None if names is None else [names[i] for i in numbers]
    recall = partial(_recall, estimate=estimate, store=store, shape=shape)
    pairs = [(key, rows[first[key]]) for key in missing]
    done = len(found) - len(missing)
    results = run(recall, pairs, names=names, n_jobs=n_jobs, verbose=verbose, done=done)
    found.update(zip(missing, results, strict=True))
    return [found[key] for key in keys]


def _recall(
    keyed: tuple[str, Any],
    *,
    estimate: Callable[[Any], Spectrum],
    store: SpectrumStore,
    shape: tuple[int, ...],
) -> Spectrum:
    """Find or estimate the spectrum of a key and its row."""
    key, row = keyed
    spectrum = store.find(key, shape)  # another process may have estimated it since
    if spectrum is None:
        spectrum = estimate(row)
        store.keep(key, spectrum)
    return spectrum
