"""Sampling rates of healthy recordings, which others must share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from emacm.recordings.inputs import described


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
