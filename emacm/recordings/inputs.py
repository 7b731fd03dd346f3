"""The form of X: a list of recordings, with the channels they must have.

What transforms them; calls of a function for each, in parallel and with their progress; and the
latest results of such calls.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import PurePath
from threading import Lock
from typing import Any, Generic, Self, TypeVar

import numpy as np
import pandas as pd
from joblib import effective_n_jobs, parallel_config
from numpy.typing import NDArray
from sklearn.base import TransformerMixin
from sklearn.utils.parallel import Parallel, delayed
from sklearn.utils.validation import check_is_fitted

from emacm._checks import located, once_hint
from emacm._saved import SavedEstimator
from emacm.recordings.names import check_channel_names as check_channel_names
from emacm.recordings.names import chosen_channels as chosen_channels
from emacm.recordings.names import printable
from emacm.recordings.recording import Recording

Value = TypeVar("Value")


def as_list(X: Any) -> list[Any]:
    """Return the entries of X, one for each recording, of whatever kind.

    Parameters
    ----------
    X : sequence or ndarray
        A list, tuple, array, pandas Series or other sequence with a fixed order.

    Returns
    -------
    list

    Raises
    ------
    TypeError
        If X is a single recording, a file path, a table, a mapping, a generator, or no sequence.
    ValueError
        If X is empty.

    Examples
    --------
    >>> as_list((1, 2))
    [1, 2]
    """
    refuse_single(X)
    if isinstance(X, pd.Series):
        X = X.to_numpy()
    if isinstance(X, str | PurePath | Mapping) or not isinstance(X, Sequence | np.ndarray):
        raise TypeError(f"X must be a list of recordings, got {received(X)}")
    entries = list(np.atleast_1d(X) if isinstance(X, np.ndarray) else X)
    if not entries:
        raise ValueError("X contains no recording; at least one is needed.")
    return entries


def refuse_single(X: Any) -> None:
    """Raise a TypeError if X is a single recording, over time or over the shaft angle."""
    if isinstance(X, Recording) or (hasattr(X, "theta_s") and hasattr(X, "meta")):
        raise TypeError("X must be a list of recordings, got a single one; write [recording].")


def as_recordings(X: Any, who: str, *, also: tuple[type, ...] = ()) -> list[Any]:
    """Return X as a list of recordings over time.

    Parameters
    ----------
    X : sequence of Recording
        Recordings.
    who : str
        Name of the estimator, for the message.
    also : tuple of type
        Other types that the estimator accepts.

    Returns
    -------
    list of Recording

    Raises
    ------
    TypeError
        If X is not a list, or an entry is of another type; the message gives its number.
    ValueError
        If X is empty.
    """
    entries = as_list(X)
    for index, entry in enumerate(entries):
        if not isinstance(entry, (Recording, *also)):
            if hasattr(entry, "theta_s"):
                name = described(entry, index)
                raise TypeError(f"{name} is over the shaft angle; put {who} before OrderResampler.")
            found = received(entry)
            raise TypeError(f"entry {index} of X must be a recording for {who}, got {found}")
    return entries


def check_channels(
    recordings: Sequence[Any],
    channels: Sequence[str],
    *,
    others: bool = True,
    ordered: bool = False,
) -> None:
    """Check that every recording has certain channels.

    Parameters
    ----------
    recordings : sequence of Recording or AngleRecording
        Recordings.
    channels : sequence of str
        Channels that each must have.
    others : bool
        Whether a recording may have more channels.
    ordered : bool
        Whether the channels must come in this order.

    Raises
    ------
    ValueError
        If a channel is missing or unexpected; the message gives the recording and the channel.
    """
    for index, recording in enumerate(recordings):
        known = recording.channels
        if known == channels:
            continue
        where = described(recording, index)
        check_channel_names(known, channels, where)
        extra = [name for name in known if name not in channels]
        if extra and not others:
            raise ValueError(
                f"{where} has a channel {extra[0]!r} besides the expected {list(channels)}. Set "
                f"channels={list(channels)} (of OrderResampler, or of the estimator) to ignore it."
            )
        if ordered and list(known) != list(channels):
            raise ValueError(
                f"{where} has its channels in the order {list(known)}, expected was "
                f"{list(channels)}. State channels={list(channels)} of OrderResampler."
            )


def described(recording: Any, index: int) -> str:
    """Return the number of a recording and its meta, as numbers change within folds."""
    meta = getattr(recording, "meta", None)
    if not isinstance(meta, Mapping) or not meta:
        return f"recording {index}"
    text = " ".join(", ".join(f"{key}={value!r}" for key, value in meta.items()).split())
    return f"recording {index} ({text if len(text) <= 200 else text[:200] + ' ...'})"


def entry_name(X: Any, index: int) -> str:
    """Return how a message names an entry of X: a row of a table, or a recording."""
    return f"row {index}" if isinstance(X, pd.DataFrame) else described(X[index], index)


def paths_or_numbers(entries: Sequence[Any]) -> list[str | int]:
    """Return the path of each entry that comes from a file, and the number of each other one."""
    return [printable(x.path) if hasattr(x, "path") else n for n, x in enumerate(entries)]


def for_each(
    function: Callable[[Any], Any], recordings: Sequence[Any], n_jobs: int | None = 1
) -> list[Any]:
    """Return what a function returns of each recording; an error names the recording.

    Examples
    --------
    >>> for_each(len, ["A", "BC"])
    [1, 2]
    """
    names = [partial(described, recording, index) for index, recording in enumerate(recordings)]
    return run(function, recordings, names=names, n_jobs=n_jobs)


def received(value: Any) -> str:
    """Name what was passed in the place of recordings, and what to do with it.

    Examples
    --------
    >>> received(None), received([])
    ('None.', 'a list.')
    """
    if isinstance(value, str | PurePath):
        return f"{str(value)!r}. Files are not opened here: use open_recording(path, layout)."
    if value is None or isinstance(value, bool | int | float):
        return f"{value!r}."
    return f"a {type(value).__name__}.{once_hint(value)}"


class RecordingTransformer(  # type: ignore[call-arg]
    TransformerMixin, SavedEstimator, auto_wrap_output_keys=None
):
    """Base of transformers from recordings to recordings.

    Subclasses learn `channels_`, and state ``auto_wrap_output_keys=None`` as well, since
    scikit-learn asks each class by itself whether to make tables of what it returns.
    """

    channels_: tuple[str, ...]

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Return the names of the channels.

        Parameters
        ----------
        input_features : ignored
            Recordings name their own channels.

        Returns
        -------
        ndarray of str
        """
        check_is_fitted(self)
        return np.array(self.channels_, dtype=object)

    def set_output(self, *, transform: str | None = None) -> Self:
        """Accept the option of `Pipeline.set_output`; it has no effect on recordings.

        Parameters
        ----------
        transform : {"default", "pandas", "polars", None}
            Has no effect here.

        Returns
        -------
        RecordingTransformer
            Itself.
        """
        return self

    def __sklearn_tags__(self) -> Any:
        """Tell scikit-learn that X is no 2-D table."""
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        return tags


def run(
    function: Callable[..., Any],
    *arguments: Sequence[Any],
    names: Sequence[Callable[[], str]] | None = None,
    n_jobs: int | None = None,
    verbose: bool | int = False,
    prefer: str = "threads",
) -> list[Any]:
    """Call a function for each recording, under joblib's active backend; by default, in threads.

    Parameters
    ----------
    function : callable
        Called with one element of each of `arguments`, as by `map`.
    *arguments : sequence
        Sequences of equal length.
    names : sequence of callable, optional
        What to put in front of the message of a ValueError or TypeError of each call.
    n_jobs : int, optional
        Number of recordings processed in parallel.
    verbose : bool or int
        Report to stderr how many recordings are begun, the rate and the time left: by tqdm, if it
        is installed, otherwise by joblib.
    prefer : {"threads", "processes"}
        Default backend.

    Returns
    -------
    list
        The results, in order.

    Notes
    -----
    In a task of a Dask cluster, recordings are processed by its worker.

    Examples
    --------
    >>> run(pow, [2, 3], [3, 2])
    [8, 9]
    """
    if names is not None:
        function, arguments = partial(_located, function), (names, *arguments)
    # There, joblib's active backend is the whole cluster again: each recording would be sent on.
    with parallel_config("threading") if _in_dask_task() else nullcontext():
        calls = zip(*arguments, strict=True)
        if effective_n_jobs(n_jobs) == 1 and not verbose:  # a job takes 20 µs more than a call
            return [function(*values) for values in calls]
        tasks = [delayed(function)(*values) for values in calls]
        if verbose and (bar := _bar()):
            tasks, verbose = bar(tasks, unit="recording"), False
        return Parallel(n_jobs=n_jobs, verbose=int(verbose), prefer=prefer)(tasks)


def _in_dask_task() -> bool:
    """Tell whether a worker of a Dask cluster calls this."""
    distributed = sys.modules.get("distributed")
    if distributed is None:
        return False
    try:
        distributed.get_worker()
    except ValueError:  # not in a task
        return False
    return True


def _located(function: Callable[..., Any], name: Callable[[], str], *values: Any) -> Any:
    with located(name):
        return function(*values)


def _bar() -> Any:
    """Return tqdm's progress bar, or None where it is not installed."""
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    return tqdm


class Recent(Generic[Value]):
    """Values by key, up to a number of bytes; the one that was not used for longest is dropped.

    The key of a value that is computed from arrays is their digest, with the settings.

    Parameters
    ----------
    bytes_limit : int
        Limit of the sum of the sizes.

    Examples
    --------
    >>> recent = Recent(100)
    >>> recent.put("a", 1.0, 60)
    >>> recent.put("b", 2.0, 60)
    >>> recent.get("a"), recent.get("b")
    (None, 2.0)
    >>> recent.put("c", 3.0, 40)
    >>> recent.get("b")
    2.0
    >>> recent.put("d", 4.0, 40)  # in place of "c", which was not used since
    >>> recent.get("b"), recent.get("c"), recent.get("d")
    (2.0, None, 4.0)
    """

    def __init__(self, bytes_limit: int) -> None:
        self._limit, self._lock, self._bytes = bytes_limit, Lock(), 0
        self._held: dict[Any, tuple[Value, int]] = {}

    def get(self, key: Any) -> Value | None:
        """Return the value of a key, or None if it is not kept."""
        with self._lock:
            if key not in self._held:
                return None
            self._held[key] = held = self._held.pop(key)  # the last to be dropped
            return held[0]

    def put(self, key: Any, value: Value, n_bytes: int) -> None:
        """Keep a value of this size; nothing is kept that is larger than the limit."""
        self.drop(key)
        with self._lock:
            self._held[key] = value, n_bytes
            self._bytes += n_bytes
            while self._bytes > self._limit:
                self._bytes -= self._held.pop(next(iter(self._held)))[1]

    def drop(self, key: Any) -> None:
        """Drop the value of a key, if it is kept."""
        with self._lock:
            self._bytes -= self._held.pop(key, (None, 0))[1]
