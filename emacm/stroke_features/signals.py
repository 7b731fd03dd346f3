"""Signals of a recording, stroke by stroke, over time or over the shaft angle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm.recordings.recording import Recording
from emacm.resampling.angle_recording import AngleRecording
from emacm.shaft.paths import ShaftPath

_TURN = 2 * np.pi

Samples = NDArray[np.floating]


class StrokeSignal(NamedTuple):
    """One channel in one stroke.

    Attributes
    ----------
    signal : ndarray of shape (n_samples,)
        Samples.
    travel : ndarray of shape (n_samples,)
        Angle travelled since the start of the stroke, at each sample [rad].
    start_angle : float
        Shaft angle at the start of the stroke [rad].
    direction : {1, -1, 0}
        Forward, reverse, or 0 where both were joined ("travel").
    fs : float or None
        Sampling rate [Hz]; None over the shaft angle.
    """

    signal: Samples
    travel: Samples
    start_angle: float
    direction: int
    fs: float | None

    @property
    def angle(self) -> Samples:
        """Shaft angle at each sample [rad]."""
        return self.start_angle + (self.direction or 1) * self.travel

    def cut(self, samples: slice) -> StrokeSignal:
        """Return some of the samples, at unchanged angles."""
        return self._replace(signal=self.signal[samples], travel=self.travel[samples])


class StrokeSignals(NamedTuple):
    """Signals of a recording in each stroke and at rest.

    Attributes
    ----------
    strokes : list of list of StrokeSignal
        Strokes in order of time, for each channel.
    rest : list of ndarray, or None
        Samples that belong to no stroke, for each channel; None over the shaft angle, where
        there are no such samples.
    """

    strokes: list[list[StrokeSignal]]
    rest: list[Samples] | None


def cut_into_strokes(
    recording: Recording | AngleRecording,
    channels: Sequence[str],
    *,
    min_speed: float = 0.0,
    min_revolutions: float = 0.0,
) -> StrokeSignals:
    """Cut channels of a recording into its strokes.

    Parameters
    ----------
    recording : Recording or AngleRecording
        A recording over time is cut at the ends of its strokes, without resampling.
        One over the shaft angle is resampled in this call.
    channels : sequence of str
        Names of the channels.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s]; a recording over the angle
        has its own value.
    min_revolutions : float
        Strokes shorter than this [revolutions] are ignored; over time they count as rest.

    Returns
    -------
    StrokeSignals

    Examples
    --------
    >>> run = Recording({"force": [0, 1, 2, 3, 4, 5]}, 1.0, velocity=[0.0, 1, 1, 0, -1, -1])
    >>> strokes, rest = cut_into_strokes(run, ["force"])
    >>> [(s.signal.tolist(), s.direction) for s in strokes[0]], rest[0].tolist()
    ([([1.0, 2.0], 1), ([4.0, 5.0], -1)], [0.0, 3.0])
    """
    if isinstance(recording, AngleRecording):
        return StrokeSignals(_over_angle(recording, channels, min_revolutions), None)
    paths = [
        path
        for path in recording.paths(min_speed=min_speed)
        if path.length >= min_revolutions * _TURN
    ]
    strokes, rest = [], []
    for name in channels:
        signal, fs = recording.signals[name], recording.fs[name]
        ranges = [path.sample_range(fs, len(signal)) for path in paths]
        strokes.append(
            [
                _over_time(signal, fs, path, *found)
                for path, found in zip(paths, ranges, strict=True)
            ]
        )
        standing = np.ones(len(signal), dtype=bool)
        for first, last in ranges:
            standing[first:last] = False
        rest.append(signal[standing])
    return StrokeSignals(strokes, rest)


def _over_time(signal: Samples, fs: float, path: ShaftPath, first: int, last: int) -> StrokeSignal:
    travel = path.travel_at(fs, first, last)
    return StrokeSignal(signal[first:last], travel, path.start_angle, path.direction, fs)


def _over_angle(
    recording: AngleRecording, channels: Sequence[str], min_revolutions: float
) -> list[list[StrokeSignal]]:
    rows = [recording.channels.index(name) for name in channels]
    strokes: list[list[StrokeSignal]] = [[] for _ in rows]
    for stroke in recording.strokes:
        if stroke.revolutions < min_revolutions:
            continue
        signals = stroke.signals  # resampled here, once
        travel = recording.theta_s * np.arange(stroke.n_angles)
        for found, row in zip(strokes, rows, strict=True):
            found.append(
                StrokeSignal(signals[row], travel, stroke.start_angle, stroke.direction, None)
            )
    return strokes
