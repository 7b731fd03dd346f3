"""Statistics of each channel in the strokes of a recording: mean, RMS, crest factor, kurtosis."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_number, check_real_array
from emacm.resampling.angle_recording import AngleRecording
from emacm.stroke_features.transformer import Row, StrokeFeatures, StrokeSignal

SECTIONS = ("stroke", "start", "stop", "rest")

Array = NDArray[np.float64]


class RecordingStatistics(StrokeFeatures):
    """Statistics of each channel in the strokes: mean, RMS, peak, crest factor, kurtosis, slope.

    Order spectra show how power is distributed over orders. They do not show the mean, the trend
    along the stroke, the peaks, or what happens while the shaft starts, stops or stands still.

    Parameters
    ----------
    statistics : sequence of str
        Statistics of the strokes: any of "mean", "rms", "std", "peak", "peak_to_peak" and "slope"
        (in the unit of the channel; the slope per revolution, in the direction of motion of the
        stroke), "crest_factor", "kurtosis" (3 for Gaussian noise) and "skewness"; see
        `emacm.stroke_features.statistics.signal_statistics`.
    channels : sequence of str, optional
        Channels to describe, in this order. Default: those of the first recording.
    by_direction : bool or "auto"
        Compute forward and reverse strokes separately, as columns ``channel+:…`` and
        ``channel-:…``. "auto": if a recording of `fit` has strokes of both directions.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s], as in `OrderResampler`. For
        resampled recordings, the value given there applies.
    min_revolutions : float
        Shorter strokes are ignored [revolutions]. A noisy shaft reference at standstill can give
        strokes of a fraction of a revolution, which `min_speed` does not exclude.
    sections : sequence of {"stroke", "start", "stop", "rest"}
        Sections to describe: whole strokes; their first and last `transient` seconds; the samples
        that belong to no stroke (or to an ignored one). All but "stroke" need recordings over time.
    section_statistics : sequence of str
        Statistics of start, stop and rest.
    transient : float
        Length of start and stop [s]; at least one sample, at most the stroke.
    n_jobs : int, optional
        Number of recordings processed in parallel, by joblib's active backend (default: threads).

    Attributes
    ----------
    channels_ : tuple of str
        Channels that are described.

    See Also
    --------
    emacm.ShaftHarmonics : Amplitude and phase at multiples of shaft speed.

    Notes
    -----
    `X` is a list of `Recording`, with samples equally weighted in time, or the output of
    `OrderResampler`, with samples equally weighted in angle. All strokes of one direction are
    pooled, so a longer stroke has more weight; for the slope, each stroke has its own level.
    Columns are named ``channel+:rms``, ``channel-:rms``, or ``channel:rms`` for both directions
    together; for sections, ``channel+:start:peak``, ``channel+:stop:peak``, ``channel:rest:peak``.

    The crest factor of a signal of zeros, and the kurtosis or skewness of a constant, are
    undefined and raise an error that gives the recording, the channel and the strokes. So do a
    recording without a stroke in one direction, and "rest" if the shaft never stands still.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import Recording, RecordingStatistics
    >>> speed = np.repeat([0.0, 20.0, 0.0, -20.0], 50)
    >>> run = Recording({"current": 0.1 * speed + 1}, 100, velocity=speed)
    >>> levels = RecordingStatistics(("mean", "rms"), sections=("stroke", "rest"))
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
        by_direction: bool | str = "auto",
        min_speed: float = 0.0,
        min_revolutions: float = 0.0,
        sections: Sequence[str] = ("stroke",),
        section_statistics: Sequence[str] = ("mean", "rms", "peak"),
        transient: float = 0.5,
        n_jobs: int | None = None,
    ) -> None:
        super().__init__(channels, by_direction, min_speed, min_revolutions, n_jobs)
        self.statistics = statistics
        self.sections = sections
        self.section_statistics = section_statistics
        self.transient = transient

    def _check_own_parameters(self) -> None:
        known = (*STATISTICS, "slope")
        check_statistics(self.statistics, "statistics", known)
        check_statistics(self.section_statistics, "section_statistics", known)
        check_statistics(self.sections, "sections", SECTIONS)
        check_number(self.transient, "transient", above=0, unit="s")
        if "rest" in self.sections and "slope" in self.section_statistics:
            raise ValueError(
                "section_statistics contains 'slope', per revolution, but at rest there are no "
                "revolutions. Leave out 'slope', or 'rest' of sections."
            )

    def _check_row(self, row: Row) -> None:
        super()._check_row(row)
        if isinstance(row, AngleRecording) and set(self.sections) != {"stroke"}:
            raise ValueError(
                f"sections = {list(self.sections)} need recordings over time, but it is over the "
                f"shaft angle. Apply RecordingStatistics to the recordings themselves, next to "
                f"OrderResampler in a FeatureUnion, or set sections=['stroke']."
            )

    def _feature_names(self) -> list[tuple[str, ...]]:
        return [
            (name,) if section == "stroke" else (section, name)
            for section in self.sections
            if section != "rest"
            for name in self._statistics_of(section)
        ]

    def _features(self, strokes: Sequence[StrokeSignal]) -> list[float]:
        values: list[float] = []
        for section in self.sections:
            if section != "rest":
                cut = [_section(stroke, section, self.transient) for stroke in strokes]
                values += _described(cut, self._statistics_of(section))
        return values

    def _rest_names(self) -> list[tuple[str, ...]]:
        return (
            [("rest", name) for name in self.section_statistics] if "rest" in self.sections else []
        )

    def _rest_features(self, rest: NDArray[np.floating]) -> Any:
        if "rest" not in self.sections:
            return []
        if not len(rest):
            raise ValueError(
                f"the shaft never stands still (min_speed = {self.min_speed:g} rad/s). Raise "
                f"min_speed above the noise of the shaft reference at rest, or leave 'rest' out "
                f"of sections."
            )
        return signal_statistics(rest, self.section_statistics)

    def _statistics_of(self, section: str) -> Sequence[str]:
        return self.statistics if section == "stroke" else self.section_statistics


def _section(stroke: StrokeSignal, section: str, transient: float) -> StrokeSignal:
    """Return the start or the stop of a stroke, or all of it."""
    if section == "stroke" or stroke.fs is None:
        return stroke
    n_samples = ceil(transient * stroke.fs * (1 - 1e-9))
    return stroke.cut(slice(n_samples) if section == "start" else slice(-n_samples, None))


def _described(strokes: Sequence[StrokeSignal], statistics: Sequence[str]) -> list[float]:
    """Pool the strokes; only the slope is computed within each."""
    signals = [stroke.signal for stroke in strokes]
    turns = [stroke.travel / (2 * np.pi) for stroke in strokes]
    pooled = np.concatenate(signals)
    return [
        common_slope(signals, turns) if name == "slope" else STATISTICS[name](pooled)
        for name in statistics
    ]


def signal_statistics(signal: ArrayLike, statistics: Sequence[str]) -> Array:
    """Compute statistics of signals.

    Parameters
    ----------
    signal : array-like of shape (..., n_samples)
        Signals in any unit U; all samples have equal weight.
    statistics : sequence of str
        Any of

        - "mean" [U], "rms" [U], "std" [U] (divided by n_samples, so that
          rms² = mean² + std²),
        - "peak" [U], the largest absolute value, and "peak_to_peak" [U],
        - "crest_factor", peak / rms: 1 for a constant, sqrt(2) for a sine,
        - "kurtosis", the fourth central moment divided by the squared variance (3 is not
          subtracted): 1.5 for a sine, 3 for Gaussian noise,
        - "skewness", the third central moment divided by the variance to the power 3/2.

    Returns
    -------
    ndarray of shape (..., n_statistics)
        In float64, in the order of `statistics`.

    Raises
    ------
    TypeError
        If the signal is not numeric.
    ValueError
        If a ratio is undefined: the kurtosis or skewness of a constant, the crest factor of zeros.

    Examples
    --------
    >>> sine = np.sin(2 * np.pi * np.arange(100) / 100)
    >>> signal_statistics(sine, ["rms", "crest_factor", "kurtosis"]).round(3).tolist()
    [0.707, 1.414, 1.5]
    """
    x = check_real_array(signal, "signal")
    return np.stack([STATISTICS[name](x) for name in statistics], axis=-1)


def common_slope(signals: Sequence[ArrayLike], turns: Sequence[ArrayLike]) -> float:
    """Fit one slope to several sections of a signal, each with a level of its own.

    Parameters
    ----------
    signals : sequence of array-like of shape (n_samples,)
        Sections of the signal, in any unit U; they may have different lengths.
    turns : sequence of array-like of shape (n_samples,)
        Position of each sample [revolutions, or any unit].

    Returns
    -------
    float
        Least-squares slope [U per unit of `turns`].

    Raises
    ------
    ValueError
        If no section has samples at two different positions.

    Notes
    -----
    The least-squares solution of ``signal[i] = level[i] + slope * turns[i]`` is the sum of the
    centred products over the sum of the centred squares (no source is cited).

    Examples
    --------
    >>> round(common_slope([[0.0, 1.0, 2.0], [9.0, 10.0]], [[0, 1, 2], [5, 6]]), 12)
    1.0
    """
    products = squares = 0.0
    for signal, position in zip(signals, turns, strict=True):
        x, t = (np.asarray(values, dtype=np.float64) for values in (signal, position))
        centred = t - t.mean()
        products += float(centred @ (x - x.mean()))
        squares += float(centred @ centred)
    if not squares > 0:
        raise ValueError(
            "a slope needs samples at two different angles. Leave 'slope' out, or use longer "
            "strokes."
        )
    return products / squares


def check_statistics(names: Any, parameter: str, known: Sequence[str]) -> tuple[str, ...]:
    """Return names of statistics as a tuple: known, and each once."""
    if isinstance(names, str) or not isinstance(names, Sequence | np.ndarray):
        raise TypeError(f"{parameter} must be a list of names such as ['rms'], got {names!r}.")
    chosen = tuple(names)
    for name in chosen:
        if name not in known:
            raise ValueError(f"{parameter} must be some of {list(known)}; got {name!r}.")
    if not chosen or len(set(chosen)) < len(chosen):
        raise ValueError(f"{parameter} must contain each name once, got {list(chosen)}.")
    return chosen


def _rms(x: Array) -> Array:
    return np.sqrt(np.mean(np.square(x, dtype=np.float64), axis=-1))


def _peak(x: Array) -> Array:
    return np.abs(x).max(axis=-1)


def _crest_factor(x: Array) -> Array:
    if not np.all(_peak(x) > 0):
        raise ValueError(
            "the crest factor of a signal of zeros is undefined. Leave 'crest_factor' or the "
            "channel out."
        )
    return _peak(x) / _rms(x)


def _moment(x: Array, name: str, power: int) -> Array:
    """Return a central moment of the standardised signal; that of a constant is an error."""
    # Samples of a constant signal differ by eight rounding errors at most.
    if np.any(np.ptp(x, axis=-1) <= 8 * np.finfo(x.dtype).eps * _peak(x)):
        raise ValueError(
            f"the {name} of a constant signal is undefined. Leave {name!r} or the channel out."
        )
    centred = x - x.mean(axis=-1, keepdims=True, dtype=np.float64)
    return np.mean((centred / _rms(centred)[..., np.newaxis]) ** power, axis=-1)


STATISTICS: dict[str, Callable[..., Any]] = {
    "mean": partial(np.mean, axis=-1, dtype=np.float64),
    "rms": _rms,
    "std": partial(np.std, axis=-1, dtype=np.float64),
    "peak": _peak,
    "peak_to_peak": partial(np.ptp, axis=-1),
    "crest_factor": _crest_factor,
    "kurtosis": partial(_moment, name="kurtosis", power=4),
    "skewness": partial(_moment, name="skewness", power=3),
}
