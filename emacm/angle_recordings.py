"""A recording seen over the shaft angle, resampled only while somebody looks at it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.recordings import Recording
from emacm.resampling import angle_count, interpolate_to_angle, spread_to_angle
from emacm.strokes import Path, stroke_paths


@dataclass(frozen=True)
class AngleRecording:
    """The strokes of one recording at uniform shaft angles.

    It holds the recording and how to resample it, not the result: a stroke is
    resampled when its `signals` are read, and forgotten when the reader lets go.

    Attributes
    ----------
    recording : Recording
        What is resampled.
    channels : tuple of str
        Channels, in this order.
    theta_s : float
        Angle between samples [rad].
    interpolation : {"linear", "cubic"}
        Used where `antialias` is False.
    antialias : bool
        Whether orders above π/theta_s are kept from folding in.
    direction : {"strokes", "forward", "reverse", "travel"}
        What counts as a stroke.
    min_speed : float
        Speed up to which the shaft counts as standing [rad/s].
    """

    recording: Recording = field(repr=False)  # joblib.Memory asks for the repr of what it keeps
    channels: tuple[str, ...]
    theta_s: float
    interpolation: str = "cubic"
    antialias: bool = True
    direction: str = "strokes"
    min_speed: float = 0.0

    @property
    def meta(self) -> Mapping[Any, Any]:
        """What else is known of the recording."""
        return self.recording.meta

    @property
    def strokes(self) -> tuple[AngleStroke, ...]:
        """The strokes in order of time; their signals are not resampled yet."""
        recording = self.recording
        paths = stroke_paths(
            recording.angle,
            recording.velocity,
            recording.shaft_fs,
            direction=self.direction,
            min_speed=self.min_speed,
        )
        return tuple(AngleStroke(self, path) for path in paths)

    def frame(self) -> pd.DataFrame:
        """Return all strokes as one table: a row an angle, a column a channel.

        Returns
        -------
        DataFrame
            Indexed by the number of the stroke and the shaft angle [rad].
        """
        tables = {
            number: pd.DataFrame(
                stroke.signals.T,
                columns=list(self.channels),
                index=pd.Index(stroke.angles, name="angle"),
            )
            for number, stroke in enumerate(self.strokes)
        }
        if not tables:
            index = pd.MultiIndex.from_arrays([[], []], names=["stroke", "angle"])
            return pd.DataFrame(index=index, columns=list(self.channels), dtype=float)
        return pd.concat(tables, names=["stroke"])


@dataclass(frozen=True)
class AngleStroke:
    """One stroke of an `AngleRecording`.

    Attributes
    ----------
    recording : AngleRecording
        The recording it belongs to.
    path : Path
        Way of the shaft.
    """

    recording: AngleRecording = field(repr=False)
    path: Path = field(repr=False)

    @property
    def direction(self) -> int:
        """Direction of turning: 1 forward, -1 reverse, 0 both ("travel")."""
        return self.path.direction

    @property
    def start_angle(self) -> float:
        """Shaft angle of the first sample [rad]."""
        return self.path.start_angle

    @property
    def n_angles(self) -> int:
        """Number of samples over the angle."""
        return angle_count(self.path, self.recording.theta_s)

    @property
    def revolutions(self) -> float:
        """Length of the stroke [revolutions]."""
        return self.path.length / (2 * np.pi)

    @property
    def angles(self) -> NDArray[np.floating]:
        """Shaft angle of each sample [rad]; for "travel", the angle run since its start."""
        sign = self.direction or 1
        return self.start_angle + sign * self.recording.theta_s * np.arange(self.n_angles)

    @property
    def signals(self) -> NDArray[np.floating]:
        """The channels at these angles, shape (n_channels, n_angles); resampled now."""
        settings, recording = self.recording, self.recording.recording
        rates = dict.fromkeys(recording.fs[name] for name in settings.channels)
        if len(rates) == 1:
            return self._resample([recording.signals[name] for name in settings.channels], *rates)
        resampled = np.empty((len(settings.channels), self.n_angles))
        for fs in rates:
            rows = [i for i, name in enumerate(settings.channels) if recording.fs[name] == fs]
            chosen = [recording.signals[settings.channels[i]] for i in rows]
            resampled[rows] = self._resample(chosen, fs)
        return resampled

    def _resample(self, channels: list[NDArray[np.floating]], fs: float) -> NDArray[np.floating]:
        settings = self.recording
        n_times = min(map(len, channels))  # equal to within one sample
        rows = [channel[:n_times] for channel in channels]
        if settings.antialias:
            return spread_to_angle(rows, fs, self.path, theta_s=settings.theta_s)[1]
        return interpolate_to_angle(
            rows, fs, self.path, theta_s=settings.theta_s, interpolation=settings.interpolation
        )[1]
