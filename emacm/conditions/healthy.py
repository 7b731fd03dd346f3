"""Healthy recordings of each condition, and what the baselines have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import compress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_unmasked, located
from emacm.decisions.costs import label_list, plain_labels
from emacm.recordings.inputs import RecordingTransformer, as_list, described, entry_name
from emacm.recordings.meta import condition_name, listed_recordings, read_meta, sorted_conditions


class Healthy(NamedTuple):
    """The healthy recordings of a fit.

    Attributes
    ----------
    mask : ndarray of bool, shape (n_recordings,)
        Which recordings of X are healthy.
    further : list
        Healthy recordings given in addition to X.
    rows : dict of condition to list of int
        Numbers of the healthy recordings of each condition, counted over those of X and then the
        further ones.
    rates : dict of str to float
        Sampling rate of each channel of the healthy recordings [Hz].
    """

    mask: NDArray[np.bool_]
    further: list[Any]
    rows: dict[Any, list[int]]
    rates: dict[str, float]


class ConditionBaseline(  # type: ignore[call-arg]
    RecordingTransformer, auto_wrap_output_keys=None
):
    """Base of the baselines, which are learned from healthy recordings of each condition.

    Subclasses learn `conditions_`, and keep the rates of the healthy recordings in `_rates`.
    """

    conditions_: tuple[Any, ...]
    _rates: dict[str, float]

    def __init__(
        self,
        *,
        condition: Any = "load",
        healthy: Any = "healthy",
        baseline_recordings: Sequence[Any] | None = None,
    ) -> None:
        self.condition = condition
        self.healthy = healthy
        self.baseline_recordings = baseline_recordings

    def __sklearn_tags__(self) -> Any:
        """Declare that y is needed, which names the healthy recordings."""
        tags = super().__sklearn_tags__()
        tags.target_tags.required = True
        return tags

    def _find_healthy(self, X: Any, y: ArrayLike | None) -> Healthy:
        """Return the healthy recordings of each condition; raise an error if one has none."""
        conditions, mask = read_meta(X, self.condition), healthy_recordings(X, y, self.healthy)
        added = [] if self.baseline_recordings is None else self.baseline_recordings
        if self.baseline_recordings is not None and not added:
            raise ValueError("baseline_recordings is empty: add recordings, or set it to None.")
        with located("baseline_recordings"):
            added = as_list(added) if added else []
            if any(isinstance(recording, str) for recording in added):  # of a model file
                raise ValueError(f"set baseline_recordings again: {added[0]}.")
            of_added = read_meta(added, self.condition) if added else []
        of_healthy = [*compress(conditions, mask), *of_added]
        rows = {
            value: [row for row, other in enumerate(of_healthy) if other == value]
            for value in sorted_conditions(of_healthy)
        }
        for value in sorted_conditions(conditions):
            if value not in rows:
                raise ValueError(
                    f"none of the {conditions.count(value)} recordings of "
                    f"{condition_name(self.condition, value)} is healthy (healthy = "
                    f"{self.healthy!r}). Add healthy ones to X or to baseline_recordings."
                )
        healthy_rows = [X[row] for row in np.flatnonzero(mask)] if are_recordings(X) else []
        known_rates = map(_rates_of, reversed([*healthy_rows, *added]))
        rates = {channel: rate for of_one in known_rates for channel, rate in of_one.items()}
        check_healthy_rates(X, rates)
        with located("baseline_recordings"):
            check_healthy_rates(added, rates)
        return Healthy(mask, [*added], rows, rates)

    def _known_conditions(self, X: Any) -> list[Any]:
        """Return the condition of each recording; raise a ValueError if it has no baseline."""
        conditions = read_meta(X, self.condition)
        for index, value in enumerate(conditions):
            if value not in self.conditions_:
                raise ValueError(
                    f"{entry_name(X, index)} has {condition_name(self.condition, value)}, but "
                    f"there are healthy recordings of {list(self.conditions_)} only. Give "
                    f"healthy recordings of it (FeatureBaseline: add_baseline, emacm score "
                    f"--healthy; otherwise baseline_recordings), or train with them."
                )
        return conditions


def healthy_recordings(X: Any, y: ArrayLike | None, healthy: Any) -> NDArray[np.bool_]:
    """Return which recordings were made of a healthy machine.

    Parameters
    ----------
    X : sequence of Recording or AngleRecording, or DataFrame
        Recordings.
    y : array-like of shape (n_recordings,) or None
        Their labels.
    healthy : label, or collection of labels
        Labels of `y`.

    Returns
    -------
    ndarray of bool, shape (n_recordings,)

    Raises
    ------
    ValueError
        If `y` is missing, has another length than X, or does not contain the label.

    Examples
    --------
    >>> from emacm import Recording
    >>> runs = [
    ...     Recording({"torque": [0, 1]}, 1, velocity=[1.0, 1.0], meta={"hours": hours})
    ...     for hours in (0, 900)
    ... ]
    >>> healthy_recordings(runs, ["new", "worn"], "new").tolist()
    [True, False]
    """
    entries = listed_recordings(X)
    if y is None:
        raise ValueError(f"healthy = {healthy!r} names labels of y: call fit(X, y).")
    wanted = [healthy] if isinstance(healthy, str) or not np.iterable(healthy) else healthy
    check_unmasked(y, "y")
    labels, wanted = label_list(y), plain_labels(wanted)
    if len(labels) != len(entries):
        raise ValueError(f"y has {len(labels)} labels for {len(entries)} recordings.")
    for label in wanted:
        if label not in labels:
            known = list(dict.fromkeys(labels))
            raise ValueError(f"healthy names {label!r}, which is not in y. y holds {known}.")
    return np.array([label in wanted for label in labels])


def are_recordings(X: Any) -> bool:
    """Return whether X is a list of recordings, over time or over the shaft angle."""
    return isinstance(X, Sequence) and all(hasattr(entry, "channels") for entry in X)


def check_healthy_rates(X: Any, healthy: Mapping[str, float]) -> None:
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
    >>> check_healthy_rates([run], {"case": 1000.0})
    >>> check_healthy_rates([run], {"case": 1250.0})
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
                    f"Use healthy recordings of the same sampling rate."
                )


def _rates_of(recording: Any) -> dict[str, float]:
    """Return the sampling rate of each channel that is used [Hz]."""
    measured = getattr(recording, "measured", recording)
    return {name: measured.fs[name] for name in recording.channels if name in measured.fs}
