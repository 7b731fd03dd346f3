"""Selection of the recordings of a healthy machine."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import located
from emacm.recordings.inputs import described, entry_name, kind_of, received
from emacm.recordings.meta import (
    called,
    condition_name,
    listed_recordings,
    meta_value,
    plain_label,
    read_meta,
    sorted_conditions,
)

_COLLECTIONS = (list, tuple, set, frozenset, np.ndarray, pd.Series, pd.Index)


class Healthy(NamedTuple):
    """The healthy recordings of a fit.

    Attributes
    ----------
    mask : ndarray of bool, shape (n_recordings,)
        Which recordings of X are healthy.
    further : list
        Healthy recordings given in addition to X.
    conditions : list of hashable
        Conditions of the healthy recordings of X, then of the further ones.
    """

    mask: NDArray[np.bool_]
    further: list[Any]
    conditions: list[Any]


def find_healthy(
    X: Any, y: ArrayLike | None, condition: Any, healthy: Any, baseline_recordings: Any
) -> Healthy:
    """Return the healthy recordings of each condition.

    Parameters
    ----------
    X : sequence of Recording or AngleRecording
        Recordings.
    y : array-like of shape (n_recordings,) or None
        Their labels; needed if `healthy` is a label.
    condition : hashable, tuple or callable
        As in `emacm.recordings.meta.read_meta`.
    healthy : label, collection of labels, mapping or callable
        As in `healthy_recordings`.
    baseline_recordings : None or sequence of Recording
        Further healthy recordings.

    Returns
    -------
    Healthy

    Raises
    ------
    TypeError, ValueError
        If an input is invalid, or a condition in X has no healthy recording (the message gives
        the condition).
    """
    found, mask = read_meta(X, condition), healthy_recordings(X, y, healthy)
    further = [] if baseline_recordings is None else baseline_recordings
    if isinstance(further, str) or not isinstance(further, Sequence):
        raise TypeError(
            f"baseline_recordings must be None or a list of recordings, got {received(further)}"
        )
    if any(isinstance(recording, str) for recording in further):
        raise ValueError(
            f"baseline_recordings are not recordings: {further[0]!r}. Set them again to fit a "
            f"model that was loaded from a model file."
        )
    with located("baseline_recordings"):
        known = read_meta(further, condition) if further else []
    for value in sorted_conditions(found):
        rows = [index for index, other in enumerate(found) if other == value]
        if not mask[rows].any() and value not in known:
            raise ValueError(
                f"none of the {len(rows)} recordings of {condition_name(condition, value)} is "
                f"healthy (healthy = {healthy!r}). Add healthy ones to X or to "
                f"baseline_recordings, or leave this condition out."
            )
    return Healthy(
        mask, [*further], [v for v, good in zip(found, mask, strict=True) if good] + known
    )


def known_conditions(X: Any, condition: Any, known: Sequence[Any]) -> list[Any]:
    """Return the condition of each recording; raise a ValueError if it has no baseline."""
    found = read_meta(X, condition)
    for index, value in enumerate(found):
        if value not in known:
            raise ValueError(
                f"{entry_name(X, index)} has {condition_name(condition, value)}, but there are "
                f"healthy recordings of {list(known)} only. Fit with healthy recordings of it, in "
                f"X or as baseline_recordings."
            )
    return found


def healthy_recordings(X: Any, y: ArrayLike | None, healthy: Any) -> NDArray[np.bool_]:
    """Return which recordings were made of a healthy machine.

    Parameters
    ----------
    X : sequence of Recording or AngleRecording, or DataFrame
        Recordings.
    y : array-like of shape (n_recordings,) or None
        Their labels; needed if `healthy` is a label.
    healthy : label, collection of labels, mapping or callable
        Labels of `y`; or {key of `meta`: value, or a list of values}, all of
        which must hold; or a function of the recording that returns a bool.

    Returns
    -------
    ndarray of bool, shape (n_recordings,)

    Raises
    ------
    TypeError
        If a function does not return a bool.
    ValueError
        If `y` is needed and missing, has another length than X, or does not contain the label;
        or a recording lacks a key.

    Examples
    --------
    >>> from emacm import Recording
    >>> runs = [
    ...     Recording({"torque": [0, 1]}, 1, velocity=[1.0, 1.0], meta={"hours": hours})
    ...     for hours in (0, 900)
    ... ]
    >>> healthy_recordings(runs, ["new", "worn"], "new").tolist()
    [True, False]
    >>> healthy_recordings(runs, None, lambda run: run.meta["hours"] < 100).tolist()
    [True, False]
    """
    entries = listed_recordings(X)
    if callable(healthy):
        returned = [called(healthy, entry, i, "healthy") for i, entry in enumerate(entries)]
        for index, (entry, value) in enumerate(zip(entries, returned, strict=True)):
            if not isinstance(value, bool | np.bool_):
                raise TypeError(
                    f"healthy as a function must return True or False, got {value!r} for "
                    f"{described(entry, index)}."
                )
        return np.array(returned, dtype=bool)
    if isinstance(healthy, Mapping):
        wanted = {key: _listed(values) for key, values in healthy.items()}
        if not wanted:
            raise ValueError("healthy must name at least one key of meta, got an empty mapping.")
        return np.array(
            [
                all(meta_value(entry, index, key, "healthy") in own for key, own in wanted.items())
                for index, entry in enumerate(entries)
            ]
        )
    return _labelled(y, len(entries), _listed(healthy))


def _listed(values: Any) -> list[Any]:
    listed = list(values) if isinstance(values, _COLLECTIONS) else [values]
    return [plain_label(value) for value in listed]


def _labelled(y: Any, n_recordings: int, healthy: list[Any]) -> NDArray[np.bool_]:
    if y is None:
        raise ValueError(
            f"healthy = {healthy} names labels of y, but no y was given. Call fit(X, y), or let "
            f"healthy read the recordings: a mapping of meta keys to values, or a function."
        )
    if isinstance(y, str | Mapping) or not isinstance(y, Iterable) or getattr(y, "ndim", 1) > 1:
        came = f"an array of shape {np.shape(y)}" if hasattr(y, "shape") else kind_of(y)
        raise TypeError(f"y must hold one label for each recording, got {came}.")
    labels = _listed(y if isinstance(y, _COLLECTIONS) else list(y))
    if len(labels) != n_recordings:
        raise ValueError(f"y has {len(labels)} labels for {n_recordings} recordings.")
    for label in healthy:
        if label not in labels:
            found = list(dict.fromkeys(labels))
            raise ValueError(f"healthy names {label!r}, which is not in y. y holds {found}.")
    if not healthy:
        raise ValueError("healthy must name at least one label of y, got none.")
    return np.array([label in healthy for label in labels])


def are_recordings(X: Any) -> bool:
    """Return whether X is a list of recordings, over time or over the shaft angle."""
    return isinstance(X, Sequence) and all(hasattr(entry, "channels") for entry in X)


def common_rates(recordings: Sequence[Any]) -> dict[str, float]:
    """Return the sampling rate of each channel of the first recording that has it [Hz]."""
    rates: dict[str, float] = {}
    for recording in recordings:
        rates = _rates_of(recording) | rates
    return rates


def check_rates(X: Any, healthy: Mapping[str, float]) -> None:
    """Raise if a recording was sampled at another rate than the healthy ones.

    Parameters
    ----------
    X : list of Recording or AngleRecording
        Recordings; anything else is not checked.
    healthy : dict of str to float
        Sampling rate of each channel of the healthy recordings [Hz].

    Raises
    ------
    ValueError
        With the recording and the channel.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import Recording
    >>> run = Recording({"case": np.zeros(50)}, 1000, velocity=1.0)
    >>> check_rates([run], {"case": 1000.0})
    >>> check_rates([run], {"case": 1250.0})
    Traceback (most recent call last):
    ...
    ValueError: recording 0: channel 'case' is sampled at 1000 Hz, but in the healthy recordings...
    """
    for index, recording in enumerate(X if are_recordings(X) else ()):
        for channel, rate in _rates_of(recording).items():
            if not np.isclose(rate, healthy.get(channel, rate), rtol=1e-6, atol=0):
                raise ValueError(
                    f"{described(recording, index)}: channel {channel!r} is sampled at "
                    f"{rate:g} Hz, but in the healthy recordings at {healthy[channel]:g} Hz. "
                    f"Features of both differ by the measurement, not by the machine: use healthy "
                    f"recordings of the same sampling rate."
                )


def _rates_of(recording: Any) -> dict[str, float]:
    """Return the sampling rate of each channel that is used [Hz]."""
    measured = getattr(recording, "measured", recording)
    return {name: measured.fs[name] for name in recording.channels if name in measured.fs}
