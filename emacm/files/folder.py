"""Recordings that read their samples from a file when these are needed."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Hashable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from emacm._checks import located
from emacm.files.column_roles import recording_arguments, start_of
from emacm.files.layout import Layout
from emacm.files.readers import READERS, read_columns
from emacm.recordings.digests import digest_of_file
from emacm.recordings.inputs import Recent
from emacm.recordings.names import printable
from emacm.recordings.recording import CONTENT, Recording

_recent: Recent[Recording] = Recent(1 << 28)  # bytes, in addition to the last of each thread
_facts: Recent[tuple[Any]] = Recent(500_000)  # so many
_last = threading.local()  # the content that this thread reads, of any size

Step = tuple[Callable[..., dict[str, Any]], tuple[Any, ...]]


class FileState(NamedTuple):
    """What a file was when it was opened, to notice that it was changed.

    Its size [bytes] and time of writing [ns]; in other processes, the digest of its content.
    """

    path: str
    size: int = 0
    written: int = 0
    digest: str = ""

    @classmethod
    def of(cls, path: str) -> FileState:
        """Return the present state of a file.

        Raises
        ------
        FileNotFoundError
            If there is none.
        """
        if not os.path.exists(path):
            raise FileNotFoundError(f"there is no file {path!r}.")
        status = os.stat(path)
        return cls(path, status.st_size, status.st_mtime_ns)

    def check(self) -> None:
        """Raise a ValueError if the file has changed since it was opened."""
        found = FileState.of(self.path)
        if self.digest:
            found = FileState(self.path, digest=digest_of_file(self.path))
        if found != self:
            raise ValueError(f"{printable(self.path)}: it was replaced or changed. Open it again.")

    def with_digest(self) -> FileState:
        """Return path and digest, by which any process can check the content of the file."""
        with suppress(OSError, ValueError):  # gone or changed: an error where samples are read
            self.check()
            return FileState(self.path, digest=digest_of_file(self.path))
        return self


class FileRecording(Recording):
    """A recording in a file: its samples are read when they are needed, and not kept for long.

    It is pickled as path, layout, digest of the file, and meta. See `open_recording`.

    Attributes
    ----------
    path : str
        Absolute path of the file.
    layout : Layout
        How the file is read.
    """

    __slots__ = ("_key", "_states", "_steps", "layout", "path")

    path: str
    layout: Layout
    _states: tuple[FileState, ...]
    _steps: tuple[Step, ...]

    @property
    def digest(self) -> str:
        """SHA-256 of channels, rates and shaft, without `meta`.

        Raises
        ------
        ValueError
            If the file was changed since the recording was opened.
        """
        self._check_files()
        return super().digest

    @property
    def identity(self) -> Hashable:
        """A key of the content in this process: the state of the files, and how they are read."""
        return self._key

    def _check_files(self) -> None:
        for state in self._states:
            state.check()

    def __getattr__(self, name: str) -> Any:
        """Read the content of the file."""
        if name in CONTENT or name == "_known":
            return getattr(self.content(), name)
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def content(self) -> Recording:
        """Return the recording in memory; it is read if it is not one of the last.

        Raises
        ------
        OSError, ImportError
            If the file is gone, or cannot be opened.
        TypeError, ValueError
            If it was changed, is damaged, or is not what the layout states. The message starts
            with the path.
        """
        held = getattr(_last, "held", None)
        if held is not None and held[0] == self._key:
            return held[1]
        content = _recent.get(self._key)
        if content is None:
            content = self._read()
            _recent.put(self._key, content, sum(array.nbytes for array in content._arrays()))
        _last.held = self._key, content
        return content

    @property
    def start(self) -> pd.Timestamp | None:
        """When the file was started, as it states itself (in UTC if it states a time zone).

        None if it does not; TDMS and MDF files do, and those with a column of dates.
        """
        return self.fact("start", lambda: self.content().once("start", lambda: None))

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels, in the order given."""
        return self.fact("channels", lambda: self.content().channels)

    def fact(self, name: Hashable, compute: Callable[[], Any]) -> Any:
        """Return a small result of the content, which is kept although the content is released."""
        found = _facts.get((self._key, name))
        if found is None:
            found = (compute(),)
            _facts.put((self._key, name), found, 1)
        return found[0]

    def release(self) -> None:
        """Drop the content from memory; it is read again when it is needed."""
        _recent.drop(self._key)
        _last.held = None

    def _read(self) -> Recording:
        if self._steps:
            change, arguments = self._steps[-1]
            content = _opened(self.layout, self._states, self._meta, self._steps[:-1]).content()
            with located(printable(self.path)):
                changed = content._derived(change, *arguments)
            changed.once("start", partial(content.once, "start", lambda: None))
            changed.once("shaft", partial(content.once, "shaft", tuple))
            return changed
        self._check_files()
        with located(printable(self.path)):
            columns = read_columns(Path(self.path))
            second = None
            for state in self._states[1:]:
                with located(printable(state.path)):
                    second = read_columns(Path(state.path))
            found = recording_arguments(columns, self.layout, second)
            for values in (*found["signals"].values(), found.get("angle"), found.get("velocity")):
                if isinstance(values, np.ndarray) and values.base is None:
                    values.flags.writeable = False  # nobody else has it: it is not copied
            recording = Recording(**found, meta=self._meta)
            recording.once("start", lambda: start_of(columns, self.layout))
            recording.once("shaft", lambda: (second or columns).statements)
        self._check_files()  # they may have been written while they were read
        return recording

    def _derived(self, change: Callable[..., dict[str, Any]], *arguments: Any) -> Recording:
        """Return a recording that reads the same file, and then changes its content."""
        steps = (*self._steps, (change, arguments))
        return _opened(self.layout, self._states, self._meta, steps)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return path, layout, digest of the file, and meta; no samples."""
        layout = replace(self.layout, meta=None)
        states = tuple(state.with_digest() for state in self._states)
        return _opened, (layout, states, self._meta, self._steps)

    def __getstate__(self) -> dict[str, Any]:
        """Return the content."""
        return self.content().__getstate__()


def open_recording(
    path: str | os.PathLike[str], layout: Layout, *, resample: bool = False
) -> FileRecording:
    """Open a recording in a file: its samples are read and checked when they are first needed.

    It is a `Recording` like any other, with the same results bit by bit. It is pickled as its
    absolute path, layout, digest of the file, and meta (less than 1 kB), so that worker processes
    read the file themselves; there, and on other computers, it must have the same path and
    content. The last recordings are kept in memory (256 MiB); a file is read as a whole, and must
    not be changed as long as the recording is used: if its size or time has changed when it is
    read again, this is an error.

    Parameters
    ----------
    path : str or Path
        A file: npz, csv (txt, tsv), wav or mat (versions up to 7.2); with the extra ``files``,
        mat (7.3), parquet, h5 (hdf5), tdms and uff (unv); with the extra ``mdf``, mf4.
    layout : Layout
        Which columns are channels, time and shaft.
    resample : bool
        As in a `Layout`: channels with uneven times are resampled to an even rate.

    Returns
    -------
    Recording
        With the attributes `path` and `layout`.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    TypeError, ValueError
        If `layout` is not a layout, or the name of the file matches its `meta` in several ways (one
        that does not match has no `meta`). When samples are read: if the file was changed, is
        damaged, or is not what the layout states; if it is no file but a device or a pipe, has its
        samples in other files (HDF5), or states more than 200 times its own size (above 256 MiB),
        so that it would fill the memory.

    Warns
    -----
    EmacmWarning
        When samples are read: if the last row of a text has no line end, and is left out; if times
        are rounded or jitter so that the rate is not exact, or samples are resampled; if an
        integer WAV file has a unit and no scale; if a file was not finished by its writer.

    See Also
    --------
    emacm.RecordingFolder : All files of a folder.
    emacm.Layout : What the columns of a file mean.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = os.path.join(folder.name, "A_worn.npz")
    >>> np.savez(path, vibration=np.sin(np.arange(4000) / 9), fs=2000)
    >>> layout = Layout(velocity="1500 rpm", units=["vibration [g]"], meta="{unit}_{state}")
    >>> recording = open_recording(path, layout)
    >>> recording
    Recording(vibration 2000 Hz; velocity 2000 Hz; 2 s, 50 revolutions; unit='A', state='worn')
    >>> folder.cleanup()
    """
    if not isinstance(layout, Layout):
        raise TypeError(f"layout must be a Layout, got {type(layout).__name__}.")
    if resample:
        layout = replace(layout, resample=True)
    file = Path(path).absolute()
    with located(printable(file)):
        states = tuple(FileState.of(str(one)) for one in layout.files_of(file))
        return _opened(layout, states, layout.meta_of(file))


def _opened(
    layout: Layout,
    states: tuple[FileState, ...],
    meta: dict[Any, Any],
    steps: tuple[Step, ...] = (),
) -> FileRecording:
    """Return a recording in files that were opened before."""
    recording = FileRecording.__new__(FileRecording)
    key = (states, layout.key, repr(meta), repr(steps))
    content = {"path": states[0].path, "layout": layout, "_states": states, "_steps": steps}
    for name, value in (content | {"_key": key, "_meta": meta}).items():
        object.__setattr__(recording, name, value)
    return recording


class RecordingFolder(Sequence[Recording]):
    """The recordings in the files of a folder, as `X` of any pipeline; none is kept in memory.

    Parameters
    ----------
    folder : str or Path
        The folder.
    layout : Layout
        How each file is read.
    pattern : str
        Which files: as for `pathlib.Path.glob`. Default: all in the folder and its subfolders.
        Only types of files that are known are opened; hidden files are not, nor those that are
        second files of others by the layout.

    Attributes
    ----------
    paths : list of Path
        The files, sorted by name; absolute.

    Raises
    ------
    FileNotFoundError
        If there is no such folder.
    ValueError
        If no file matches, or the name of one matches the `meta` of the layout in several ways.

    See Also
    --------
    emacm.open_recording : One file.
    emacm.Layout : What the columns of a file mean.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for unit in "BA":
    ...         np.savez(os.path.join(folder, f"{unit}_2.npz"), current=np.ones(50))
    ...     layout = Layout(fs=25, velocity=3.0, meta="{unit}_{run:d}")
    ...     [recording.meta["unit"] for recording in RecordingFolder(folder, layout)]
    ['A', 'B']
    """

    def __init__(
        self, folder: str | os.PathLike[str], layout: Layout, pattern: str = "**/*"
    ) -> None:
        self.folder, self.layout, self.pattern = Path(folder).absolute(), layout, pattern
        if not self.folder.is_dir():
            raise FileNotFoundError(f"there is no folder {str(folder)!r}.")
        self.paths = recording_files([self.folder], layout, pattern)
        self._recordings = [open_recording(path, layout) for path in self.paths]

    def __len__(self) -> int:
        """Return the number of files."""
        return len(self._recordings)

    def __getitem__(self, index: Any) -> Any:
        """Return one recording, or a list of them."""
        return self._recordings[index]

    def __repr__(self) -> str:
        """Folder and number of recordings."""
        return f"RecordingFolder({str(self.folder)!r}, {len(self)} recordings)"


def recording_files(
    paths: Sequence[Path],
    layout: Layout | None = None,
    pattern: str = "**/*",
    *,
    may_be_empty: bool = False,
) -> list[Path]:
    """Return files, and in place of folders the files in them that can be recordings, sorted.

    These match the pattern, are of a known type, not hidden, and not second files, from which the
    layout takes the motion of the shaft.

    Raises
    ------
    ValueError
        If a folder has no such file, unless it `may_be_empty`.
    """
    found: list[Path] = []
    for path in paths:
        files = _files_in(path, layout or Layout(), pattern) if path.is_dir() else [path]
        if not files and not may_be_empty:
            raise ValueError(
                f"the folder {str(path)!r} has no file that matches {pattern!r} and is of one of "
                f"the types {sorted(READERS)}. Name other files, or another pattern."
            )
        found += files
    return list(dict.fromkeys(found))


def _files_in(folder: Path, layout: Layout, pattern: str) -> list[Path]:
    found = {
        path
        for path in folder.glob(pattern)
        if path.suffix.lower() in READERS and not path.name.startswith(".") and path.is_file()
    }
    others: set[Path] = set()
    for path in found:
        with suppress(ValueError):  # of a name that the pattern of meta does not fit
            others.update(layout.files_of(path)[1:])
    return sorted(found - others)
