"""Files that are written as a whole, objects that go on from a state, estimators with a version.

Loading an estimator of another version warns. Model files hold no DataFrame and no mapping whose
keys are not texts: while one is written, costs and the like are written as lists. Recordings are
replaced by their digests: a fitted baseline contains what was learned from them. A folder of stored
spectra is no part of a model.
"""

from __future__ import annotations

import importlib
import json
import os
import platform
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from io import BytesIO
from pathlib import Path
from threading import get_ident
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator

from emacm._statements import warn
from emacm._version import __version__

try:
    import fcntl
except ImportError:  # on Windows
    fcntl = None  # type: ignore[assignment]

_KEY = "_emacm_version"
_KIND = "_emacm_kind"  # key of a value that is written as lists
_as_lists: ContextVar[bool] = ContextVar("_as_lists", default=False)


class Resumable:
    """An object that can be continued from the values of some attributes.

    Attributes
    ----------
    held : tuple of str
        Names of these attributes; all, if there are none. They are arrays, numbers, texts, named
        tuples, objects that have `state` and `restore`, and lists and dictionaries of them. An
        object is continued, so it must have been made: of a dictionary of objects, those that are
        in the state are kept.
    """

    held: ClassVar[tuple[str, ...]] = ()

    def state(self) -> dict[str, Any]:
        """Return all that `restore` needs."""
        return {name: getattr(self, name) for name in self.held or vars(self)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state that was packed and unpacked."""
        for name, value in self.state().items():
            setattr(self, name, _restored_value(value, state[name]))


def _restored_value(value: Any, state: Any) -> Any:
    if hasattr(value, "restore"):
        value.restore(state)
        return value
    if isinstance(value, dict):
        return {k: _restored_value(v, state[k]) for k, v in value.items() if k in state}
    if isinstance(value, list) and any(hasattr(item, "restore") for item in value):
        return [_restored_value(*pair) for pair in zip(value, state, strict=True)]
    return value._make(state) if hasattr(value, "_make") else state


def packed(state: dict[str, Any]) -> bytes:
    """Return a state as the bytes of an npz file.

    Parameters
    ----------
    state : dict
        Arrays, numbers, texts and None, objects that have such a `state`, and lists, tuples and
        dictionaries of them, whose keys are texts or numbers.

    Returns
    -------
    bytes

    Examples
    --------
    >>> unpacked(packed({"values": (1.5, {"name": "current", 2: np.arange(3)})}))
    {'values': [1.5, {'name': 'current', '2': array([0, 1, 2])}]}
    """
    arrays: list[Any] = []

    def stored(value: Any) -> Any:
        if hasattr(value, "state"):
            return value.state()
        arrays.append(value)
        return {"array": len(arrays) - 1}

    text, stream = json.dumps(state, default=stored), BytesIO()
    np.savez(stream, *arrays, text=text)
    return stream.getvalue()


def unpacked(content: bytes) -> dict[str, Any]:
    """Return the state whose bytes `packed` returned; lists for tuples, and texts as keys.

    Raises
    ------
    ValueError
        If it is not such a state.
    """
    try:
        with np.load(BytesIO(content), allow_pickle=False) as file:

            def restored(entry: dict[str, Any]) -> Any:
                return file[f"arr_{entry['array']}"] if "array" in entry else entry

            return json.loads(file["text"].item(), object_hook=restored)
    except Exception as error:  # zip, zlib and NumPy raise many kinds
        raise ValueError("it is no state of OrderMonitor, or not written completely.") from error


class SavedEstimator(BaseEstimator):
    """Base class of the estimators: pickles contain the version of emacm.

    Loading under another version gives an EmacmWarning, as scikit-learn's
    `InconsistentVersionWarning` does for its own estimators: results may differ.
    """

    def __getstate__(self) -> dict[str, Any]:
        state = {**super().__getstate__(), _KEY: __version__}
        if not _as_lists.get():
            return state
        return {name: None if name == "memory" else _written(v) for name, v in state.items()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        state = dict(state)
        saved = state.pop(_KEY, "an unknown version")
        if saved != __version__:
            warn(
                "version",
                f"{type(self).__name__} was saved by emacm {saved} and is loaded by emacm "
                f"{__version__}: its results may differ. Fit it again.",
                stacklevel=2,
            )
        super().__setstate__({name: _restored(value) for name, value in state.items()})


def installed_versions() -> dict[str, str]:
    """Return the versions of emacm, Python and the libraries on which results depend."""
    found = {"emacm": __version__, "python": platform.python_version()}
    for name in ("numpy", "scipy", "sklearn", "pandas", "skops"):
        with suppress(ImportError):  # skops is optional
            found[name] = importlib.import_module(name).__version__
    return found


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Give a path to write to, and then put this file in place of `path`: a file is never half.

    If this fails, nothing is left behind, and the OSError names the file.
    """
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.{get_ident()}.part")
    try:
        yield unfinished
        os.replace(unfinished, path)
    except OSError as error:
        error.filename = str(path)
        raise
    finally:
        unfinished.unlink(missing_ok=True)


def write_whole(path: Path, content: bytes) -> None:
    """Write a file as a whole, as `written_whole` does."""
    with written_whole(path) as unfinished:
        unfinished.write_bytes(content)


@contextmanager
def locked(path: Path, *, wait: bool = False) -> Iterator[None]:
    """Let no other process use `path` meanwhile; nothing is locked on systems without fcntl.

    The lock on a file beside `path` ends with the process, also if it is killed.

    Raises
    ------
    ValueError
        If another process uses `path`, unless it shall `wait` for its end.
    """
    if fcntl is None:
        yield
        return
    beside, free = path.with_name(f".{path.name}.lock"), False
    while not free:
        with open(beside, "w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
                free = os.fstat(file.fileno()).st_nlink > 0  # not that of a process just ended
            except BlockingIOError:
                free = False
            if free:
                try:
                    yield
                finally:
                    beside.unlink(missing_ok=True)
            elif not wait:
                raise ValueError(
                    f"{path} is used by another process. Wait for its end, or give another file."
                )


@contextmanager
def values_as_lists() -> Iterator[None]:
    """Let estimators give their state as lists, as a model file holds it."""
    token = _as_lists.set(True)
    try:
        yield
    finally:
        _as_lists.reset(token)


def _written(value: Any) -> Any:
    """Return a value as texts, numbers, lists, tuples, dictionaries of texts, and arrays."""
    if isinstance(value, pd.DataFrame):
        return {_KIND: "frame", **_written(value.to_dict("split"))}
    if hasattr(value, "digest") and hasattr(value, "signals"):
        return f"a recording that is not stored in the model file; digest {value.digest}"
    if type(value) is dict and all(type(key) is str for key in value):
        return {key: _written(inner) for key, inner in value.items()}
    if isinstance(value, Mapping):
        items = [(_written(key), _written(inner)) for key, inner in value.items()]
        return {_KIND: "mapping", "items": items}
    if type(value) in (list, tuple):
        return type(value)(map(_written, value))
    return value


def _restored(value: Any) -> Any:
    """Return what `_written` was given."""
    if type(value) in (list, tuple):
        return type(value)(map(_restored, value))
    if type(value) is not dict:
        return value
    restored = {key: _restored(inner) for key, inner in value.items()}
    kind = restored.pop(_KIND, None)
    if kind == "frame":
        return pd.DataFrame(**restored)
    return dict(restored["items"]) if kind == "mapping" else restored
