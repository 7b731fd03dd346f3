"""A recording over the shaft angle; it is resampled when its signals are read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from math import isclose
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from emacm import _kernels
from emacm._checks import check_choice
from emacm.recordings.inputs import as_recordings, check_channels, described
from emacm.recordings.recording import Recording
from emacm.resampling.spreading import DESIGN, spread_rows
from emacm.shaft.motion import Series, ShaftPath

INTERPOLATIONS = ("linear", "cubic")


@dataclass(frozen=True)
class AngleRecording:
    """The strokes of one recording at uniform shaft angles.

    It holds the recording and how to resample it, not the result: a stroke is
    resampled each time its `signals` are read.

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

    @property
    def timed(self) -> list[tuple[Series, float]]:
        """Each channel over time, and its sampling rate [Hz]."""
        series, fs = self.measured.series, self.measured.fs
        return [(series[name], fs[name]) for name in self.channels]

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
        """Travel of the shaft along each stroke."""
        measured = self.measured.paths(self.direction, self.min_speed, self.max_rest)
        return [path.geared(self.ratio) for path in measured]

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Type of the resampled signals: float32 if all channels are."""
        return np.result_type(*(series.dtype for series, _ in self.timed))

    @property
    def rate_groups(self) -> list[list[int]]:
        """Indices of the channels, grouped by sampling rate."""
        rates = [fs for _, fs in self.timed]
        return [[i for i, fs in enumerate(rates) if fs == rate] for rate in dict.fromkeys(rates)]

    @property
    def settings(self) -> tuple[Any, ...]:
        """All that the strokes depend on besides the recording."""
        return tuple(getattr(self, item.name) for item in fields(self)[1:])

    @property
    def flat_order(self) -> float:
        """Order up to which the response of band-limited resampling is flat."""
        return DESIGN.flat * np.pi / self.theta_s

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
            number: pd.DataFrame(stroke.signals.T, stroke.angles, list(self.channels))
            for number, stroke in enumerate(self.strokes)
        }
        return pd.concat(tables, names=["stroke", "angle"])


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
        rows = range(len(self.parent.channels))
        return _joined(self.blocks(rows), len(rows)).astype(self.parent.dtype, copy=False)

    def blocks(self, rows: Sequence[int]) -> Iterator[NDArray[np.floating]]:
        """Resample channels block by block, for strokes of any length.

        Parameters
        ----------
        rows : sequence of int
            Indices of channels of any sampling rates, in any order.

        Returns
        -------
        iterator of ndarray of shape (n_rows, n_angles)
            Consecutive blocks, of at most some hundred thousand samples; of channels of several
            sampling rates, a single one.
        """
        groups = [[row for row in rows if row in group] for group in self.parent.rate_groups]
        if sum(map(bool, groups)) == 1:
            return self._of_one_rate(rows)
        joined = np.empty((len(rows), self.path.count(self.parent.theta_s)))
        for group in filter(None, groups):
            places = [rows.index(row) for row in group]
            joined[places] = _joined(self._of_one_rate(group), len(group))
        return iter([joined])

    def _of_one_rate(self, rows: Sequence[int]) -> Iterator[NDArray[np.floating]]:
        """Resample channels of one sampling rate block by block."""
        parent, timed = self.parent, self.parent.timed
        series, rates = zip(*(timed[row] for row in rows), strict=True)
        n_times = min(map(len, series))  # equal to within one sample
        signals = [s if len(s) == n_times else s[:n_times] for s in series]
        grid = signals, rates[0], self.path, parent.theta_s
        if parent.antialias:
            return spread_rows(*grid)
        return interpolated(*grid, parent.interpolation)


def _joined(blocks: Iterator[NDArray[np.floating]], n_rows: int) -> NDArray[np.floating]:
    """Return blocks as one array; a stroke that ends before its first grid angle has none."""
    return np.concatenate([np.empty((n_rows, 0)), *blocks], axis=1)


def interpolated(
    rows: Sequence[Series], fs: float, path: ShaftPath, theta_s: float, interpolation: str
) -> Iterator[NDArray[np.floating]]:
    """Yield the rows at the grid angles, block by block.

    Parameters
    ----------
    rows : sequence of ndarray of shape (n_times,), or of objects that can be sliced like one
        Signals at times ``n / fs``.
    fs : float
        Their sampling rate [Hz].
    path : ShaftPath
        Travel of the shaft over time.
    theta_s : float
        Angle between samples of the result [rad].
    interpolation : {"linear", "cubic"}
        Straight lines, Eq. (2.13) of Chirico, or a cubic spline over time.

    Yields
    ------
    ndarray of shape (n_rows, n_angles)
        The next angles; all blocks together cover the whole path.
    """
    first, last = path.sample_range(fs, len(rows[0]))
    n_angles, done, farthest = path.count(theta_s), 0, -np.inf
    loops = _kernels.loops
    # Less at once where the angle grid is dense, so that it takes no more memory than the signals;
    # a spline needs ten times the memory of its samples.
    at_once = loops.INTERPOLATED_AT_ONCE // (1 if interpolation == "linear" else 4)
    at_once = max(2, int(at_once / max(1.0, path.fastest / (fs * theta_s))))
    for start in range(first, last - 1, at_once):
        stop = min(start + at_once, last - 1) + 1  # the sample that the next part begins with
        travel = path.travel_at(fs, start, stop)
        # A shaft that stands or shivers repeats angles; what counts is when it passes them for
        # good.
        travel = np.maximum(np.maximum.accumulate(travel), farthest)
        farthest = float(travel[-1])
        end = n_angles if stop == last else min(int(np.ceil(farthest / theta_s)), n_angles)
        if end <= done:
            continue
        values = np.empty((len(rows), end - done))
        if interpolation == "linear":
            near = [row[start:stop] for row in rows]
            loops.interpolate_linear(travel, done, theta_s, near, values)
        else:
            indices = np.interp(theta_s * np.arange(done, end), travel, np.arange(start, stop))
            for value, row in zip(values, rows, strict=True):
                value[:] = _spline(row, start, stop, indices)
        yield values
        done = end


def _spline(
    row: Series, start: int, stop: int, indices: NDArray[np.floating], *, margin: int = 48
) -> NDArray[np.floating]:
    """Return a cubic spline at fractional indices between samples `start` and `stop`.

    It forgets what lies n samples away like 0.27**n, so some more on either side suffice.
    """
    low = max(0, start - margin)
    near = row[low : stop + margin].astype(np.float64)
    spline = make_interp_spline(np.arange(len(near)), near, k=min(3, len(near) - 1))
    return spline(indices - low)


def as_angle_recordings(X: Any, who: str) -> list[AngleRecording]:
    """Return X as a list of recordings over the shaft angle.

    Parameters
    ----------
    X : sequence of AngleRecording
        What `OrderResampler` returns.
    who : str
        Name of the estimator, for the message.

    Returns
    -------
    list of AngleRecording

    Raises
    ------
    TypeError
        If X is not a list, or an entry is of another type, such as a recording over time.
    ValueError
        If X is empty.
    """
    rows = as_recordings(X, who, also=(AngleRecording,))
    for index, row in enumerate(rows):
        if not isinstance(row, AngleRecording):
            raise TypeError(
                f"{described(row, index)} is over time; put an OrderResampler before {who}."
            )
    return rows


def check_alike(
    rows: Sequence[AngleRecording],
    channels: Sequence[str],
    theta_s: float | None,
    who: str,
    *,
    by_direction: bool = False,
    exactly: bool = True,
) -> None:
    """Compare recordings with those of `fit`.

    Parameters
    ----------
    rows : sequence of AngleRecording
        Recordings.
    channels : sequence of str
        Channels in `fit`.
    theta_s : float or None
        Angle between samples in `fit` [rad].
    who : str
        Name of the estimator, for the message.
    by_direction : bool
        Whether forward and reverse strokes must be separate.
    exactly : bool
        Whether no other channels are allowed, nor another order of them.

    Raises
    ------
    ValueError
        If a recording has other channels, was not resampled at this angle, or its directions were
        joined.
    """
    check_channels(rows, channels, others=not exactly, ordered=exactly)
    for index, row in enumerate(rows):
        if theta_s is None or not isclose(row.theta_s, theta_s, rel_tol=1e-12):
            raise ValueError(
                f"{described(row, index)} was resampled with theta_s = {row.theta_s!r}, but "
                f"{who} has {theta_s!r}. Use the same theta_s, or fit again."
            )
        if by_direction and row.direction == "travel":
            raise ValueError(
                "by_direction needs strokes, but direction='travel' of OrderResampler joins "
                "both directions. Use direction='strokes'."
            )


def separates_directions(by_direction: bool | str, rows: Sequence[Any]) -> bool:
    """Return whether forward and reverse strokes are separate.

    Parameters
    ----------
    by_direction : bool or "auto"
        "auto": if a recording has strokes of at least one revolution in both directions.
    rows : sequence of AngleRecording or ndarray
        Rows of `fit`; arrays have no direction.

    Returns
    -------
    bool

    Raises
    ------
    ValueError
        If `by_direction` is neither.
    """
    check_choice(by_direction, "by_direction", (True, False, "auto"))
    if by_direction != "auto":
        return bool(by_direction)
    turning = (
        {stroke.direction for stroke in row.strokes if stroke.revolutions >= 1}
        for row in rows
        if isinstance(row, AngleRecording)
    )
    return any({1, -1} <= directions for directions in turning)
