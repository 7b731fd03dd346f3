"""Spectra that are kept between calls: in memory, and in files that processes share.

The key of a spectrum is the content of its recording and all settings. Files contain numbers only,
no pickled code. Each is written under a temporary name and then renamed, and ends with a checksum;
whatever cannot be read, or is not a spectrum of the expected shape, is estimated again.

`joblib.Memory` is not used: it took five times as long to read a spectrum, it deletes foreign
files in the same folder, and it accepts a damaged file that can still be read.
"""

from __future__ import annotations

import io
import os
import re
import uuid
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import fields
from functools import lru_cache, partial
from hashlib import sha256
from pathlib import Path
from stat import S_ISREG
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
from emacm.recordings.digests import content_digest
from emacm.recordings.recent import Recent
from emacm.resampling.angle_recording import AngleRecording

NUMERICS = 4  # incremented whenever the numbers of a spectrum change; part of every key
BYTES_ON_DISK = 1 << 30
BYTES_IN_MEMORY = 1 << 28

_FOLDER = "emacm_spectra"
_KEY = re.compile("[0-9a-f]{64}")
_KEPT = 0.9  # fraction of the limit that is kept when files are deleted
_CHECKED = 0.05  # fraction of the limit that is written between two checks of the folder

Spectrum = NDArray[np.floating]


_recent: Recent[Spectrum] = Recent(BYTES_IN_MEMORY)
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
        Maximum size of all files [bytes]. Default: 1 GiB. In memory, all stores of a process hold
        at most 256 MiB together.

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

    def __init__(self, folder: str | os.PathLike[str], *, bytes_limit: int = BYTES_ON_DISK) -> None:
        self.folder = os.path.abspath(os.fspath(folder))
        self.bytes_limit = check_count(bytes_limit, "bytes_limit")

    def made(self) -> SpectrumStore:
        """Make the folder, if it does not exist, and return the store."""
        try:
            os.makedirs(os.path.join(self.folder, _FOLDER), exist_ok=True)
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
            spectrum = self._read(key)
            if spectrum is not None:
                _recent.put((self.folder, key), spectrum, spectrum.nbytes)
        return spectrum if spectrum is not None and spectrum.shape == shape else None

    def keep(self, key: str, spectrum: Spectrum) -> None:
        """Keep a spectrum under a key of 64 hexadecimal digits."""
        writer = io.BytesIO()
        np.save(writer, np.ascontiguousarray(spectrum, np.float64), allow_pickle=False)
        body = writer.getvalue()
        decoded = _decoded(body)
        _recent.put((self.folder, key), decoded, decoded.nbytes)
        content = body + _checksum(key, body)
        if len(content) > self.bytes_limit:
            return
        try:
            self._write(key, content)
        except OSError as error:
            warnings.warn(
                f"spectra cannot be kept in {self.folder!r}: {error}. They will be estimated "
                f"again. Free space there, or set memory of OrderPSD to another folder.",
                RuntimeWarning,
                stacklevel=2,
            )

    def _file(self, key: str) -> Path:
        return Path(self.folder, _FOLDER, key[:2], key)

    def _read(self, key: str) -> Spectrum | None:
        file = self._file(key)
        try:
            content = file.read_bytes() if file.is_file() else b""  # not a pipe, which would block
            body, checksum = content[:-32], content[-32:]
            return _decoded(body) if checksum == _checksum(key, body) else None
        except (OSError, ValueError):
            return None

    def _write(self, key: str, content: bytes) -> None:
        final = self._file(key)
        final.parent.mkdir(parents=True, exist_ok=True)
        unfinished = final.with_name(f"{key}.{uuid.uuid4().hex}.part")
        try:
            unfinished.write_bytes(content)
            os.replace(unfinished, final)
        finally:
            unfinished.unlink(missing_ok=True)
        _written[self.folder] = _written.get(self.folder, np.inf) + len(content)
        if _written[self.folder] > _CHECKED * self.bytes_limit:
            _written[self.folder] = 0.0
            self._make_room()

    def _make_room(self) -> None:
        """Delete the oldest files where the limit is exceeded; other files are not touched."""
        files = []
        for file in Path(self.folder, _FOLDER).glob("[0-9a-f][0-9a-f]/*"):
            name, _, ending = file.name.partition(".")
            own = _KEY.fullmatch(name) and name[:2] == file.parent.name
            if own and (not ending or ending.endswith("part")) and not file.parent.is_symlink():
                with suppress(OSError):  # deleted by another process
                    status = file.lstat()
                    if S_ISREG(status.st_mode):
                        files.append((status.st_mtime_ns, status.st_size, file))
        excess = sum(size for _, size, _ in files) - self.bytes_limit
        if excess > 0:
            excess += round((1 - _KEPT) * self.bytes_limit)
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
        kind: Any = type(row)
        settings += repr([getattr(row, name) for name in _compared(kind)])
    else:
        content = content_digest("row", [row])
    return sha256(f"{content}{settings}".encode("utf-8", "surrogatepass")).hexdigest()


@lru_cache(maxsize=8)
def _compared(kind: type[AngleRecording]) -> list[str]:
    """Return what a recording is resampled by."""
    return [item.name for item in fields(kind) if item.compare and item.name != "measured"]


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
    key_of = partial(spectrum_key, settings=joblib.hash((known, __version__, NUMERICS)))
    keys = [key_of(row) for row in rows]
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
    recall = partial(_recall, estimate=estimate, store=store, key_of=key_of, shape=shape)
    done = len(found) - len(missing)
    results = run(
        recall, [rows[i] for i in numbers], names=names, n_jobs=n_jobs, verbose=verbose, done=done
    )
    found.update(zip(missing, results, strict=True))
    return [found[key] for key in keys]


def _recall(
    row: Any,
    *,
    estimate: Callable[[Any], Spectrum],
    store: SpectrumStore,
    key_of: Callable[[Any], str],
    shape: tuple[int, ...],
) -> Spectrum:
    """Find or estimate a spectrum."""
    key = key_of(row)
    spectrum = store.find(key, shape)  # another process may have estimated it since
    if spectrum is None:
        spectrum = estimate(row)
        if key_of(row) == key:  # not if its file was written to in the meantime
            store.keep(key, spectrum)
    return spectrum


def _checksum(key: str, body: bytes) -> bytes:
    """Return 32 bytes that depend on the content of a file and on its key."""
    return sha256(key.encode() + body).digest()


def _decoded(body: bytes) -> Spectrum:
    """Return the array of an npy file; it cannot be made writeable, even on purpose.

    Raises
    ------
    ValueError
        If it is none, or no power spectrum: float64, finite, not negative.
    """
    reader = io.BytesIO(body)
    if np.lib.format.read_magic(reader) != (1, 0):
        raise ValueError("not a version 1 npy file.")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(reader)
    if fortran or dtype != np.float64:
        raise ValueError("not a spectrum.")
    spectrum = np.frombuffer(body, dtype, offset=reader.tell()).reshape(shape)
    if not (np.isfinite(spectrum).all() and spectrum.min(initial=0.0) >= 0):
        raise ValueError("not a spectrum.")
    return spectrum
