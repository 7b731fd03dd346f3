"""What a channel showed in each stroke of a recording, over time or over the shaft angle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm.recordings.recording import Recording
from emacm.resampling.angle_recording import AngleRecording
from emacm.shaft.paths import ShaftPath
from emacm.shaft.strokes import stroke_paths

_TURN = 2 * np.pi

Samples = NDArray[np.floating]


class StrokeSignal(NamedTuple):
    """One channel in one stroke.

    Attributes
    ----------
    signal : ndarray of shape (n_samples,)
        Its samples.
    travel : ndarray of shape (n_samples,)
        Angle run since the start of the stroke at each sample [rad].
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
        """Return some of the samples; angles stay what they are."""
        return self._replace(signal=self.signal[samples], travel=self.travel[samples])


class SeenRecording(NamedTuple):
    """The channels of a recording, stroke by stroke, and while the shaft stands.

    Attributes
    ----------
    strokes : list of list of StrokeSignal
        Strokes in order of time, for each channel.
    rest : list of ndarray, or None
        For each channel, the samples that belong to no stroke; None over the shaft angle,
        where there are none.
    """

    strokes: list[list[StrokeSignal]]
    rest: list[Samples] | None


def see_recording(
    recording: Recording | AngleRecording,
    channels: Sequence[str],
    *,
    min_speed: float = 0.0,
    min_revolutions: float = 0.0,
) -> SeenRecording:
    """Cut channels of a recording into its strokes.

    Parameters
    ----------
    recording : Recording or AngleRecording
        A recording over time is cut by `emacm.shaft.strokes.stroke_paths`; its samples stay as they
        were taken. One over the shaft angle is resampled now.
    channels : sequence of str
        Which channels.
    min_speed : float
        Speed up to which the shaft counts as standing [rad/s]; a recording over the angle
        has its own.
    min_revolutions : float
        Strokes shorter than this [revolutions] are passed over; over time they belong to rest.

    Returns
    -------
    SeenRecording

    Examples
    --------
    >>> run = Recording({"force": [0, 1, 2, 3, 4, 5]}, 1.0, velocity=[0.0, 1, 1, 0, -1, -1])
    >>> seen = see_recording(run, ["force"])
    >>> [(s.signal.tolist(), s.direction) for s in seen.strokes[0]], seen.rest[0].tolist()
    ([([1.0, 2.0], 1), ([4.0, 5.0], -1)], [0.0, 3.0])
    """
    if isinstance(recording, AngleRecording):
        return SeenRecording(_over_angle(recording, channels, min_revolutions), None)
    paths = [
        path
        for path in stroke_paths(*recording.motion, recording.shaft_fs, min_speed=min_speed)
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
    return SeenRecording(strokes, rest)


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
