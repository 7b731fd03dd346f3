"""A recording over the shaft angle; it is resampled when its signals are read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.recordings.recording import Recording
from emacm.resampling.interpolation import interpolated
from emacm.resampling.kept_signals import KeptSignals
from emacm.resampling.spreading import spread_rows
from emacm.shaft.motion import Series
from emacm.shaft.paths import ShaftPath

Self = TypeVar("Self", bound="AngleRecording")

_MANY = 1000  # strokes; of noise at standstill there may be more, which are not kept


@dataclass(frozen=True)
class AngleRecording:
    """The strokes of one recording at uniform shaft angles.

    It holds the recording and how to resample it, not the result: a stroke is
    resampled each time its `signals` are read, unless a `SignalCache` keeps them.

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
        Whether orders above π/theta_s are filtered out, so that they are not aliased.
    direction : {"strokes", "forward", "reverse", "travel"}
        What counts as a stroke.
    min_speed : float
        Speed up to which the measured shaft counts as standing still [rad/s].
    ratio : float
        Revolutions of the shaft of interest per revolution of the measured shaft.
    max_rest : float or None
        Longest time at standstill that does not end a stroke [s].
    timed : list of (Series, float)
        Each channel over time, and its sampling rate [Hz]; looked up when the recording is made.
    """

    measured: Recording = field(repr=False)  # joblib.Memory asks for the repr of what it keeps
    channels: tuple[str, ...]
    theta_s: float
    interpolation: str = "cubic"
    antialias: bool = True
    direction: str = "strokes"
    min_speed: float = 0.0
    ratio: float = 1.0
    max_rest: float | None = None
    timed: list[tuple[Series, float]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Look the channels up once, not for each stroke."""
        series, fs = self.measured.series, self.measured.fs
        self.__dict__["timed"] = [(series[name], fs[name]) for name in self.channels]

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields, for pickle and joblib's hash; nothing that is computed from them."""
        return {item.name: getattr(self, item.name) for item in fields(self) if item.init}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the fields."""
        self.__dict__.update(state)
        self.__post_init__()

    @property
    def kept(self) -> KeptSignals | None:
        """Signals that are kept for the next reader, or None."""
        return self.__dict__.get("_kept")

    def keeping(self: Self, max_bytes: int) -> Self:
        """Return the same recording, which keeps resampled signals up to this size."""
        same = object.__new__(type(self))
        same.__dict__.update(vars(self), _kept=KeptSignals(max_bytes))
        return same

    @property
    def meta(self) -> Mapping[Any, Any]:
        """Further properties of the recording."""
        return self.measured.meta

    @property
    def strokes(self) -> tuple[AngleStroke, ...]:
        """The strokes in order of time; their signals are not resampled yet."""
        return tuple(AngleStroke(self, path) for path in self.paths)

    @property
    def paths(self) -> list[ShaftPath]:
        """Travel of the shaft along each stroke; found once, unless a file may change meanwhile."""
        found: list[ShaftPath] | None = self.__dict__.get("_paths")
        if found is None:
            measured = self.measured.paths(self.direction, self.min_speed, self.max_rest)
            found = [path.geared(self.ratio) for path in measured]
            if len(found) <= _MANY and not self.measured.in_files:
                self.__dict__["_paths"] = found
        return found

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Type of the resampled signals: float32 if all channels are."""
        return np.result_type(*(series.dtype for series, _ in self.timed))

    @property
    def rate_groups(self) -> list[list[int]]:
        """Indices of the channels, grouped by sampling rate."""
        rates = [fs for _, fs in self.timed]
        return [[i for i, fs in enumerate(rates) if fs == rate] for rate in dict.fromkeys(rates)]

    def strokes_by_kind(self, by_direction: bool) -> list[tuple[str, list[AngleStroke]]]:
        """Return all strokes, or forward and reverse ones apart, each with what to call one."""
        strokes = self.strokes
        if not by_direction:
            return [("stroke", list(strokes))]
        ways = ((1, "forward stroke"), (-1, "reverse stroke"))
        return [(kind, [s for s in strokes if s.direction == sign]) for sign, kind in ways]

    def frame(self) -> pd.DataFrame:
        """Return all strokes as one table: one row per angle, one column per channel.

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
        Travel of the shaft.
    """

    parent: AngleRecording = field(repr=False)
    path: ShaftPath = field(repr=False)

    @property
    def direction(self) -> int:
        """Direction of rotation: 1 forward, -1 reverse, 0 both ("travel")."""
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
        """Shaft angle of each sample [rad]; for "travel", the angle covered since its start."""
        sign = self.direction or 1
        return self.start_angle + sign * self.parent.theta_s * np.arange(self.n_angles)

    @property
    def signals(self) -> NDArray[np.floating]:
        """The channels at these angles, shape (n_channels, n_angles); resampled now."""
        resampled = np.empty((len(self.parent.channels), self.n_angles), self.parent.dtype)
        done = 0
        for block in self.blocks(range(len(resampled))):
            resampled[:, done : done + block.shape[1]] = block
            done += block.shape[1]
        return resampled

    def blocks(self, rows: Sequence[int]) -> Iterator[NDArray[np.floating]]:
        """Resample channels block by block, for strokes of any length.

        Parameters
        ----------
        rows : sequence of int
            Indices of channels of any sampling rates, in any order.

        Returns
        -------
        iterator of ndarray of shape (n_rows, n_angles)
            Consecutive blocks, of at most some hundred thousand samples. They may be kept for
            other readers, so they must not be changed.
        """
        wanted = [[row for row in rows if row in group] for group in self.parent.rate_groups]
        groups = [group for group in wanted if group]
        if len(groups) == 1:
            return self._of_one_rate(rows)
        places = [[list(rows).index(row) for row in group] for group in groups]
        return _align_streams([self._of_one_rate(group) for group in groups], places)

    def _of_one_rate(self, rows: Sequence[int]) -> Iterator[NDArray[np.floating]]:
        """Resample channels of one sampling rate block by block."""
        parent = self.parent
        series, rates = zip(*(parent.timed[row] for row in rows), strict=True)
        n_times = min(map(len, series))  # equal to within one sample
        signals = [s if len(s) == n_times else s[:n_times] for s in series]
        if parent.antialias:
            stream = spread_rows(signals, rates[0], self.path, parent.theta_s)
        else:
            stream = interpolated(
                signals, rates[0], self.path, parent.theta_s, parent.interpolation
            )
        if parent.kept is None:
            return stream
        return parent.kept.blocks(self.path, rows, self.path.count(parent.theta_s), stream)


def _align_streams(
    streams: Sequence[Iterator[NDArray[np.floating]]], places: Sequence[Sequence[int]]
) -> Iterator[NDArray[np.floating]]:
    """Join streams of blocks of unequal lengths to blocks of all rows, each at its place."""
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
