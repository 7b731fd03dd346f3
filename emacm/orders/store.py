"""Spectra that are kept: in this process, and in files that processes share.

A spectrum is found again by the content of its recording and by all settings. In
front is a dictionary that serves the whole process; behind it lies a folder with a
file for each spectrum. A file is written under another name and then renamed, and it
carries a digest of itself, so that what a killed process or a full disk leaves behind
is never taken for a spectrum. Files hold numbers alone, no pickled code.

`joblib.Memory` is not used for the files: it goes by the time of the last access, which
most systems do not keep, deletes what others keep in the same folder, and serves a
damaged file that still reads. (It also took five times as long, 0.4 ms to read and
0.9 ms to write a spectrum.)
"""

from __future__ import annotations

import io
import os
import time
import uuid
import warnings
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from threading import Lock
from typing import Any

import joblib
import numpy as np
from numpy.typing import NDArray
from sklearn.utils.validation import check_memory

from emacm._checks import check_count

try:
    import fcntl
except ImportError:  # no such locks: two processes may then estimate the same spectrum
    fcntl = None  # type: ignore[assignment]

BYTES_ON_DISK = 1 << 30
BYTES_IN_MEMORY = 1 << 28

_FOLDER = "emacm_spectra"
_HEAD = b"emacm spectrum 1\n"
_KEPT = 0.9  # share of the limit that is left when something must go
_LOOK = 0.05  # share of the limit that is written between two looks at the folder
_ABANDONED = 3600.0  # s; after which a file that was not finished never will be
_PAUSE = 0.002  # s


class _Recent:
    """The spectra last used in this process, up to a number of bytes."""

    def __init__(self, bytes_limit: int) -> None:
        self._limit = bytes_limit
        self.clear()

    def get(self, key: Any) -> NDArray[np.floating] | None:
        with self._lock:
            if key in self._held:
                self._held.move_to_end(key)
            return self._held.get(key)

    def put(self, key: Any, spectrum: NDArray[np.floating]) -> None:
        with self._lock:
            old = self._held.pop(key, None)
            self._bytes -= 0 if old is None else old.nbytes
            self._held[key] = spectrum
            self._bytes += spectrum.nbytes
            while self._bytes > self._limit:
                self._bytes -= self._held.popitem(last=False)[1].nbytes

    def clear(self) -> None:
        self._lock = Lock()  # a forked child may have inherited it locked
        self._held: OrderedDict[Any, NDArray[np.floating]] = OrderedDict()
        self._bytes = 0


_recent = _Recent(BYTES_IN_MEMORY)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_recent.clear)
_written: dict[str, float] = {}  # bytes this process wrote to a folder since it last looked there


class SpectrumStore:
    """A folder of spectra, bounded in size, with those last used at hand in memory.

    `OrderPSD` takes one as its `memory`, in place of a folder. Several processes and
    threads may use the same folder at the same time. What was used least lately
    goes first; processes that write at the same time may pass the limit by 5 % each.
    To start anew, delete the folder (and call `forget` in processes that go on).

    Parameters
    ----------
    folder : str or path
        Where the files go, in a folder ``emacm_spectra`` of it.
    bytes_limit : int
        Size that the files may have together [bytes]. Default: 1 GiB. In memory, all
        stores of a process hold 256 MiB together.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from emacm.orders.store import SpectrumStore
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     store = SpectrumStore(folder)
    ...     store.keep("a" * 64, np.ones(3))
    ...     print(store.find("a" * 64), store.find("b" * 64))
    [1. 1. 1.] None
    """

    def __init__(self, folder: str | os.PathLike[str], *, bytes_limit: int = BYTES_ON_DISK) -> None:
        self.folder = os.path.abspath(os.fspath(folder))
        self.bytes_limit = check_count(bytes_limit, "bytes_limit")

    def made(self) -> SpectrumStore:
        """Make the folder, where it does not exist, and return the store."""
        try:
            os.makedirs(os.path.join(self.folder, _FOLDER), exist_ok=True)
        except OSError as error:
            raise ValueError(
                f"memory = {self.folder!r} cannot be made a folder of spectra: {error}. "
                f"Name one that can be written to."
            ) from error
        return self

    def find(self, key: str) -> NDArray[np.floating] | None:
        """Return the spectrum kept under a key, or None; nobody can write to it."""
        spectrum = _recent.get((self.folder, key))
        if spectrum is None:
            spectrum = self._read(key)
            if spectrum is None:
                return None
            _recent.put((self.folder, key), spectrum)
        with suppress(OSError):  # gone from the folder, or not ours to touch
            os.utime(self._file(key))  # used, so it is not the next to go
        return spectrum

    def keep(self, key: str, spectrum: NDArray[np.floating]) -> None:
        """Keep a spectrum under a key of 64 hexadecimal digits."""
        writer = io.BytesIO()
        np.save(writer, np.ascontiguousarray(spectrum), allow_pickle=False)
        body = writer.getvalue()
        content = _HEAD + _seal(key, body) + body
        _recent.put((self.folder, key), _readable(body))
        if len(content) > self.bytes_limit:
            return
        try:
            self._write(key, content)
        except OSError as error:
            warnings.warn(
                f"spectra cannot be kept in {self.folder!r}: {error}. They will be estimated "
                f"again. Make room there, or set memory of OrderPSD to another folder.",
                RuntimeWarning,
                stacklevel=2,
            )

    @contextmanager
    def claimed(self, key: str, patience: float = 0.0) -> Iterator[bool]:
        """Tell others that a spectrum is in work, and yield False if it is already.

        The claim ends with the process that made it, however that ends.

        Parameters
        ----------
        key : str
            The spectrum.
        patience : float
            How long to wait for others [s].
        """
        handle = self._handle(key)
        if handle is None:
            yield True
            return
        until = time.monotonic() + patience
        try:
            while not (mine := _locked(handle)) and time.monotonic() < until:
                time.sleep(_PAUSE)
            yield mine
        finally:
            fcntl.flock(handle, fcntl.LOCK_UN)  # a child forked meanwhile has the handle, too
            os.close(handle)

    def _handle(self, key: str) -> int | None:
        """Open what a claim locks: the shelf, which stays, while files come and go."""
        if fcntl is None:
            return None
        try:
            return os.open(self._shelf(key), os.O_RDONLY)
        except OSError:
            return None  # `keep` will say what is wrong with the folder

    def _shelf(self, key: str) -> Path:
        shelf = Path(self.folder, _FOLDER, key[:2])
        shelf.mkdir(parents=True, exist_ok=True)
        return shelf

    def _file(self, key: str) -> str:
        return os.path.join(self.folder, _FOLDER, key[:2], key)

    def _read(self, key: str) -> NDArray[np.floating] | None:
        try:
            content = Path(self._file(key)).read_bytes()
        except OSError:
            return None
        start = len(_HEAD) + sha256().digest_size
        body = content[start:]
        whole = content[:start] == _HEAD + _seal(key, body)
        return _readable(body) if whole else None

    def _write(self, key: str, content: bytes) -> None:
        final = self._file(key)
        unfinished = self._shelf(key) / f"{key}.{uuid.uuid4().hex}.part"
        try:
            unfinished.write_bytes(content)
            os.replace(unfinished, final)
        finally:
            unfinished.unlink(missing_ok=True)
        _written[self.folder] = _written.get(self.folder, np.inf) + len(content)
        if _written[self.folder] > _LOOK * self.bytes_limit:
            _written[self.folder] = 0.0
            self._make_room()

    def _make_room(self) -> None:
        """Delete what was used least lately, and what was never finished."""
        files = []
        for entry in _scanned(os.path.join(self.folder, _FOLDER)):
            try:
                status = entry.stat()
                if entry.name.endswith(".part"):
                    if time.time() - status.st_mtime > _ABANDONED:
                        os.unlink(entry.path)
                    continue
            except OSError:
                continue  # another process was quicker
            files.append((status.st_mtime_ns, status.st_size, entry.path))
        excess = sum(size for _, size, _ in files) - self.bytes_limit
        if excess <= 0:
            return
        excess += round((1 - _KEPT) * self.bytes_limit)
        for _, size, path in sorted(files):
            if excess <= 0:
                break
            Path(path).unlink(missing_ok=True)
            excess -= size


def forget() -> None:
    """Let go of what this process holds in memory; files stay."""
    _recent.clear()


def open_store(memory: Any) -> SpectrumStore | None:
    """Return the store that `memory` of an estimator stands for.

    Parameters
    ----------
    memory : None, str, path, joblib.Memory or SpectrumStore
        A folder, however it is named.

    Returns
    -------
    SpectrumStore or None

    Raises
    ------
    TypeError
        If it is none of these, or a memory that is no folder.
    ValueError
        If it is no memory at all (scikit-learn's answer), or the folder cannot be made.
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


def _seal(key: str, body: bytes) -> bytes:
    """Digest of what a file holds, and for which key."""
    return sha256(key.encode() + body).digest()


def _readable(body: bytes) -> NDArray[np.floating]:
    """Return an array that nobody can make writeable, not even on purpose."""
    reader = io.BytesIO(body)
    np.lib.format.read_magic(reader)
    shape, _, dtype = np.lib.format.read_array_header_1_0(reader)
    return np.frombuffer(body, dtype, offset=reader.tell()).reshape(shape)


def _locked(handle: int) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True  # a file system without locks: go ahead
    return True


def _scanned(folder: str) -> Iterator[os.DirEntry[str]]:
    """Yield the files on all shelves of a folder."""
    try:
        with os.scandir(folder) as shelves:
            for shelf in shelves:
                with os.scandir(shelf.path) as files:
                    yield from files
    except OSError:
        return
