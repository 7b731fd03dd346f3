"""Checks of the samples that come next in a stream."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_real_array
from emacm.recordings.channel_names import check_channel_names

Samples = NDArray[np.floating]

_FLOAT = np.dtype(np.float64)
_ON = (
    "Nothing of this block was taken: repair the samples and push them again, or flush() and go on "
    "after them."
)


class StreamInput:
    """Checks blocks of samples, and unwraps wrapped angles.

    Parameters
    ----------
    channels : sequence of str
        Names of the channels.
    groups : mapping of float to sequence of int
        Sampling rates [Hz], each with the channels that have it.
    shaft_fs : float
        That of the shaft reference [Hz].
    max_speed : float
        Highest speed of the shaft [rad/s].
    wrapped : bool
        Whether angles are wrapped at 2π.
    """

    def __init__(
        self,
        channels: Sequence[str],
        groups: Mapping[float, Sequence[int]],
        shaft_fs: float,
        max_speed: float,
        wrapped: bool,
    ) -> None:
        self._channels, self._groups, self._shaft_fs = channels, groups, shaft_fs
        self._max_speed, self._wrapped = max_speed, wrapped
        self._labels = [f"channel {name!r}" for name in channels]
        self.reset()

    def reset(self) -> None:
        """Begin another recording."""
        self._measured = np.empty(0)  # the last angle
        self._last = np.empty(0)  # the same, unwrapped
        self._added = 0.0  # the difference
        self._next = self._measured, self._last, self._added

    def checked(
        self, signals: Any, shaft: Any, reference: str, times: Sequence[float]
    ) -> list[list[Samples]]:
        """Return the samples of the channels of each group, and of the shaft, as arrays.

        Parameters
        ----------
        signals, shaft : array-like
            As for `OrderMonitor.push`.
        reference : {"velocity", "angle"}
            What `shaft` is.
        times : sequence of float
            Time of the first sample of each group and of the shaft [s].

        Returns
        -------
        list of list of ndarray of shape (n_times,)
        """
        rows = self._rows(signals)
        streams = []
        for (rate, group), time in zip(self._groups.items(), times, strict=False):
            taken = [_samples(rows[k], self._labels[k], rate, time) for k in group]
            lengths = [len(row) for row in taken]
            if min(lengths) < max(lengths):
                k = int(np.not_equal(lengths, lengths[0]).argmax())
                raise ValueError(
                    f"channels of {rate:g} Hz must have equally many samples in a block, got "
                    f"{lengths[0]} and {lengths[k]} of {self._channels[group[k]]!r}."
                )
            streams.append(taken)
        motion = _samples(shaft, reference, self._shaft_fs, times[-1])
        if reference == "angle":
            motion = self._unwrapped(motion)
        self._check_speed(motion, reference, times[-1])
        return [*streams, [motion]]

    def accept(self) -> None:
        """Go on after the samples that were checked last."""
        self._measured, self._last, self._added = self._next

    def state(self) -> dict[str, Any]:
        """Return all that `restore` needs."""
        return {"measured": self._measured, "last": self._last, "added": self._added}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state."""
        self._measured, self._last = state["measured"], state["last"]
        self._added = float(state["added"])

    def _rows(self, signals: Any) -> Sequence[Any]:
        if isinstance(signals, Mapping):
            if tuple(signals) != self._channels:
                check_channel_names(list(signals), self._channels, "the block")
            return [signals[name] for name in self._channels]
        if not isinstance(signals, list | tuple):
            signals = np.asarray(signals)
            signals = [signals] if signals.ndim < 2 else signals  # which has too few rows
        rows = list(signals)
        if len(rows) != len(self._channels):
            raise ValueError(
                f"signals must map channels to samples, or have a row for each of the channels "
                f"{list(self._channels)}, got {len(rows)} rows."
            )
        return rows

    def _check_speed(self, shaft: Samples, reference: str, time: float) -> None:
        speed = shaft
        if reference == "angle":
            speed = np.diff(np.concatenate([self._last, shaft])) * self._shaft_fs
        if not len(speed) or max(speed.max(), -speed.min()) <= self._max_speed:
            return
        speed = np.abs(speed)
        place = int(np.argmax(speed > self._max_speed))
        raise ValueError(
            f"the shaft turns at {speed[place]:.6g} rad/s at "
            f"{time + (place + len(shaft) - len(speed)) / self._shaft_fs:.6f} s, above max_speed = "
            f"{self._max_speed:g} rad/s. {_ON} Raise max_speed if the speed is real; an angle that "
            f"is wrapped at 2 pi needs wrapped=True."
        )

    def _unwrapped(self, measured: Samples) -> Samples:
        """Return angles that go on from the last one, as `numpy.unwrap` does for all at once."""
        angle, added = measured, self._added
        if self._wrapped and len(measured):
            steps = np.diff(np.concatenate([self._measured, measured]))
            turned = np.mod(steps + np.pi, 2 * np.pi) - np.pi
            turned[(turned == -np.pi) & (steps > 0)] = np.pi
            jumps = np.where(np.abs(steps) < np.pi, 0.0, turned - steps)
            sums = np.cumsum(np.concatenate([[added], jumps]))
            added = float(sums[-1])
            angle = measured + sums[-len(measured) :]
        last = np.concatenate([self._last, angle])[-1:]
        self._next = np.concatenate([self._measured, measured])[-1:], last, added
        return angle


def _samples(values: Any, name: str, fs: float, time: float) -> Samples:
    """Return finite samples, none or more, of a block that begins at `time`."""
    samples = np.empty(0)
    if type(values) is np.ndarray and values.dtype is _FLOAT:
        samples = values
    elif not isinstance(values, list | tuple | np.ndarray) or len(values):
        samples = check_real_array(values, name).astype(np.float64, copy=False)
    if samples.ndim != 1:
        raise ValueError(f"{name} must be one-dimensional, got shape {samples.shape}.")
    # The sum of squares is much faster than to look at each; it may also be too large.
    if not isfinite(samples.dot(samples)) and not np.isfinite(samples).all():
        place = int(np.isfinite(samples).argmin())
        raise ValueError(
            f"{name} is {samples[place]} at {time + place / fs:.6f} s, sample {place} of the "
            f"block. {_ON}"
        )
    return samples
