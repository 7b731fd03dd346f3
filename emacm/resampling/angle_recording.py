"""A recording seen over the shaft angle, resampled only while somebody looks at it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.recordings.recording import Recording
from emacm.resampling.to_angle import angle_blocks
from emacm.shaft.paths import ShaftPath
from emacm.shaft.strokes import stroke_paths


@dataclass(frozen=True)
class AngleRecording:
    """The strokes of one recording at uniform shaft angles.

    It holds the recording and how to resample it, not the result: a stroke is
    resampled when its `signals` are read, and forgotten when the reader lets go.

    Attributes
    ----------
    measured : Recording
        The recording over time.
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

    measured: Recording = field(repr=False)  # joblib.Memory asks for the repr of what it keeps
    channels: tuple[str, ...]
    theta_s: float
    interpolation: str = "cubic"
    antialias: bool = True
    direction: str = "strokes"
    min_speed: float = 0.0

    @property
    def meta(self) -> Mapping[Any, Any]:
        """What else is known of the recording."""
        return self.measured.meta

    @property
    def strokes(self) -> tuple[AngleStroke, ...]:
        """The strokes in order of time; their signals are not resampled yet."""
        paths = stroke_paths(
            *self.measured.motion,
            self.measured.shaft_fs,
            direction=self.direction,
            min_speed=self.min_speed,
        )
        return tuple(AngleStroke(self, path) for path in paths)

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Type of the resampled signals: float32 if all channels are."""
        return np.result_type(*(self.measured.series[name].dtype for name in self.channels))

    @property
    def rate_groups(self) -> list[list[int]]:
        """Numbers of the channels, those of one sampling rate together."""
        rates = [self.measured.fs[name] for name in self.channels]
        return [[i for i, fs in enumerate(rates) if fs == rate] for rate in dict.fromkeys(rates)]

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
    parent : AngleRecording
        The recording it belongs to.
    path : ShaftPath
        Way of the shaft.
    """

    parent: AngleRecording = field(repr=False)
    path: ShaftPath = field(repr=False)

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
        return self.path.count(self.parent.theta_s)

    @property
    def revolutions(self) -> float:
        """Length of the stroke [revolutions]."""
        return self.path.length / (2 * np.pi)

    @property
    def angles(self) -> NDArray[np.floating]:
        """Shaft angle of each sample [rad]; for "travel", the angle run since its start."""
        sign = self.direction or 1
        return self.start_angle + sign * self.parent.theta_s * np.arange(self.n_angles)

    @property
    def signals(self) -> NDArray[np.floating]:
        """The channels at these angles, shape (n_channels, n_angles); resampled now."""
        resampled = np.empty((len(self.parent.channels), self.n_angles), self.parent.dtype)
        for rows in self.parent.rate_groups:
            done = 0
            for block in self.blocks(rows):
                resampled[rows, done : done + block.shape[1]] = block
                done += block.shape[1]
        return resampled

    def blocks(self, rows: Sequence[int]) -> Iterator[NDArray[np.floating]]:
        """Resample some channels a block at a time, for strokes of any length.

        Parameters
        ----------
        rows : sequence of int
            Numbers of channels that were sampled at one rate, such as one of
            `AngleRecording.rate_groups`.

        Returns
        -------
        iterator of ndarray of shape (n_rows, n_angles)
            Blocks that continue one another.
        """
        settings, recording = self.parent, self.parent.measured
        names = [settings.channels[row] for row in rows]
        channels = [recording.series[name] for name in names]
        n_times = min(map(len, channels))  # equal to within one sample
        return angle_blocks(
            [c if len(c) == n_times else c[:n_times] for c in channels],
            recording.fs[names[0]],
            self.path,
            theta_s=settings.theta_s,
            antialias=settings.antialias,
            interpolation=settings.interpolation,
        )

    def joint_blocks(self, rows: Sequence[int]) -> Iterator[NDArray[np.floating]]:
        """Resample channels of any sampling rates a block at a time, side by side.

        Parameters
        ----------
        rows : sequence of int
            Numbers of channels, in any order.

        Returns
        -------
        iterator of ndarray of shape (n_rows, n_angles)
            Blocks that continue one another.
        """
        wanted = [[row for row in rows if row in group] for group in self.parent.rate_groups]
        groups = [group for group in wanted if group]
        if len(groups) == 1:
            return self.blocks(rows)
        places = [[list(rows).index(row) for row in group] for group in groups]
        return _abreast([self.blocks(group) for group in groups], places)


def _abreast(
    streams: Sequence[Iterator[NDArray[np.floating]]], places: Sequence[Sequence[int]]
) -> Iterator[NDArray[np.floating]]:
    """Yield streams of blocks of unequal lengths as blocks of all rows, each at its place."""
    held: list[NDArray[np.floating] | None] = [next(stream, None) for stream in streams]
    while all(block is not None for block in held):
        parts = [block for block in held if block is not None]
        length = min(part.shape[1] for part in parts)
        joint = np.empty((sum(map(len, places)), length), np.result_type(*parts))
        for place, part in zip(places, parts, strict=True):
            joint[place] = part[:, :length]
        if length:
            yield joint
        for number, part in enumerate(parts):
            more = part.shape[1] > length
            held[number] = part[:, length:] if more else next(streams[number], None)
