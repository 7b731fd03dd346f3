"""Level and shape of each channel in the strokes of a recording, as named columns."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_number
from emacm.resampling.angle_recording import AngleRecording
from emacm.stroke_features.levels import (
    STATISTICS,
    check_statistics,
    common_slope,
    signal_statistics,
)
from emacm.stroke_features.signals import StrokeSignal
from emacm.stroke_features.transformer import Row, StrokeFeatures

PARTS = ("stroke", "start", "stop", "rest")


class RecordingStatistics(StrokeFeatures):
    """Describe level and shape of each channel, stroke by stroke.

    Order spectra tell how power spreads over orders; they do not see the mean, the trend along
    the stroke, the peaks, or what happens while the shaft starts, stops or stands.

    Parameters
    ----------
    statistics : sequence of str
        Of the strokes, any of "mean", "rms", "std", "peak", "peak_to_peak" and "slope" (in the
        unit of the channel; the slope per revolution of the stroke's own motion), "crest_factor",
        "kurtosis" (not less 3) and "skewness"; see
        `emacm.stroke_features.levels.signal_statistics`.
    channels : sequence of str, optional
        Channels to describe, in this order. Default: those of the first recording.
    by_direction : bool
        Give forward and reverse strokes columns of their own, ``channel+:…`` and ``channel-:…``.
    min_speed : float
        Speed up to which the shaft counts as standing [rad/s], as for `OrderResampler`; over
        the shaft angle that one's holds.
    min_revolutions : float
        Shorter strokes are passed over [revolutions]. Where the shaft's reference is noisy at
        rest, jitter makes strokes of a fraction of a revolution that `min_speed` cannot tell.
    parts : sequence of {"stroke", "start", "stop", "rest"}
        What is described: whole strokes; their first and last `transient` seconds; what belongs
        to no stroke (or to one passed over). All but "stroke" need recordings over time.
    part_statistics : sequence of str
        Statistics of start, stop and rest.
    transient : float
        Length of start and stop [s]; at least a sample, at most the stroke.
    n_jobs : int, optional
        Recordings in work at the same time, under joblib's active backend (by default, threads).

    Attributes
    ----------
    channels_ : tuple of str
        Channels that are described.

    Notes
    -----
    `X` is a list of `Recording`, whose samples count alike in time, or what `OrderResampler`
    returns, whose samples count alike in angle. All strokes of one direction are pooled as if
    they were one, so a longer one counts more; only the slope lets each have a level of its own.
    Columns are named ``channel+:rms``, ``channel-:rms``, or ``channel:rms`` of both directions;
    of parts ``channel+:start:peak``, ``channel+:stop:peak``, ``channel:rest:peak``.

    A crest factor of zeros, and kurtosis or skewness of a constant, do not exist: that is an
    error which names recording, channel and strokes. So is a recording without a stroke of
    a direction, and one whose shaft never stands where "rest" is wanted.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import Recording, RecordingStatistics
    >>> speed = np.repeat([0.0, 20.0, 0.0, -20.0], 50)
    >>> run = Recording({"current": 0.1 * speed + 1}, 100, velocity=speed)
    >>> levels = RecordingStatistics(("mean", "rms"), parts=("stroke", "rest"))
    >>> levels.set_output(transform="pandas").fit_transform([run]).iloc[0, :5]
    current+:mean        3.0
    current+:rms         3.0
    current-:mean       -1.0
    current-:rms         1.0
    current:rest:mean    1.0
    Name: 0, dtype: float64
    """

    def __init__(
        self,
        statistics: Sequence[str] = ("mean", "rms", "peak", "crest_factor", "kurtosis", "slope"),
        *,
        channels: Sequence[str] | None = None,
        by_direction: bool = True,
        min_speed: float = 0.0,
        min_revolutions: float = 0.0,
        parts: Sequence[str] = ("stroke",),
        part_statistics: Sequence[str] = ("mean", "rms", "peak"),
        transient: float = 0.5,
        n_jobs: int | None = None,
    ) -> None:
        self.statistics = statistics
        self.channels = channels
        self.by_direction = by_direction
        self.min_speed = min_speed
        self.min_revolutions = min_revolutions
        self.parts = parts
        self.part_statistics = part_statistics
        self.transient = transient
        self.n_jobs = n_jobs

    def _check_own_parameters(self) -> None:
        known = (*STATISTICS, "slope")
        check_statistics(self.statistics, "statistics", known)
        check_statistics(self.part_statistics, "part_statistics", known)
        check_statistics(self.parts, "parts", PARTS)
        check_number(self.transient, "transient", above=0, unit="s")
        if "rest" in self.parts and "slope" in self.part_statistics:
            raise ValueError(
                "part_statistics holds 'slope', which is over the revolutions of a stroke, but a "
                "shaft at rest runs none. Leave out 'slope', or 'rest' of parts."
            )

    def _check_row(self, row: Row) -> None:
        super()._check_row(row)
        if isinstance(row, AngleRecording) and set(self.parts) != {"stroke"}:
            raise ValueError(
                f"parts = {list(self.parts)} need the time, but it is over the shaft angle. Give "
                f"RecordingStatistics the recordings themselves, beside OrderResampler in a "
                f"FeatureUnion, or set parts=['stroke']."
            )

    def _feature_names(self) -> list[tuple[str, ...]]:
        return [
            (name,) if part == "stroke" else (part, name)
            for part in self.parts
            if part != "rest"
            for name in self._statistics_of(part)
        ]

    def _features(self, strokes: Sequence[StrokeSignal]) -> list[float]:
        values: list[float] = []
        for part in self.parts:
            if part != "rest":
                cut = [_part(stroke, part, self.transient) for stroke in strokes]
                values += _described(cut, self._statistics_of(part))
        return values

    def _rest_names(self) -> list[tuple[str, ...]]:
        return [("rest", name) for name in self.part_statistics] if "rest" in self.parts else []

    def _rest_features(self, rest: NDArray[np.floating]) -> Any:
        if "rest" not in self.parts:
            return []
        if not len(rest):
            raise ValueError(
                f"the shaft never stands (min_speed = {self.min_speed:g} rad/s). Raise min_speed "
                f"above the noise of the shaft's reference at rest, or leave 'rest' out of parts."
            )
        return signal_statistics(rest, self.part_statistics)

    def _statistics_of(self, part: str) -> Sequence[str]:
        return self.statistics if part == "stroke" else self.part_statistics


def _part(stroke: StrokeSignal, part: str, transient: float) -> StrokeSignal:
    """Cut the start or the stop out of a stroke."""
    if part == "stroke" or stroke.fs is None:
        return stroke
    n_samples = ceil(transient * stroke.fs * (1 - 1e-9))
    return stroke.cut(slice(n_samples) if part == "start" else slice(-n_samples, None))


def _described(strokes: Sequence[StrokeSignal], statistics: Sequence[str]) -> list[float]:
    """Pool the strokes; only a slope is taken within each."""
    levels = [name for name in statistics if name != "slope"]
    values: dict[str, float] = {}
    if levels:
        pooled = np.concatenate([stroke.signal for stroke in strokes])
        values = dict(zip(levels, signal_statistics(pooled, levels).tolist(), strict=True))
    if "slope" in statistics:
        turns = [stroke.travel / (2 * np.pi) for stroke in strokes]
        values["slope"] = common_slope([stroke.signal for stroke in strokes], turns)
    return [values[name] for name in statistics]
