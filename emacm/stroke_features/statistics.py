"""Statistics of each channel in the strokes of a recording: mean, RMS, crest factor, kurtosis."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_choice
from emacm.stroke_features.transformer import StrokeFeatures, StrokeSignal

Array = NDArray[np.float64]


class RecordingStatistics(StrokeFeatures):
    """Statistics of each channel in the strokes: mean, RMS, peak, crest factor, kurtosis, slope.

    Order spectra show how power is distributed over orders. They do not show the mean, the trend
    along the stroke, or the peaks.

    Parameters
    ----------
    statistics : sequence of str
        Any of, for a channel in a unit U,

        - "mean" [U], "rms" [U], "std" [U] (divided by the number of samples, so that
          rms² = mean² + std²),
        - "peak" [U], the largest absolute value, and "peak_to_peak" [U],
        - "slope" [U per revolution], in the direction of motion of the stroke,
        - "crest_factor", peak / rms: 1 for a constant, sqrt(2) for a sine,
        - "kurtosis", the fourth central moment divided by the squared variance (3 is not
          subtracted): 1.5 for a sine, 3 for Gaussian noise,
        - "skewness", the third central moment divided by the variance to the power 3/2.
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
    together.

    The crest factor of a signal of zeros, and the kurtosis or skewness of a constant, are
    undefined and raise an error that gives the recording, the channel and the strokes. So does a
    recording without a stroke in one direction.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import Recording, RecordingStatistics
    >>> speed = np.repeat([0.0, 20.0, 0.0, -20.0], 50)
    >>> run = Recording({"current": 0.1 * speed + 1}, 100, velocity=speed)
    >>> levels = RecordingStatistics(("mean", "rms")).set_output(transform="pandas")
    >>> levels.fit_transform([run]).iloc[0]
    current+:mean    3.0
    current+:rms     3.0
    current-:mean   -1.0
    current-:rms     1.0
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
        n_jobs: int | None = None,
    ) -> None:
        super().__init__(channels, by_direction, min_speed, min_revolutions, n_jobs)
        self.statistics = statistics

    def _check_own_parameters(self) -> None:
        if not isinstance(self.statistics, list | tuple | np.ndarray):
            raise TypeError(f"statistics must be a list of names, got {self.statistics!r}.")
        for name in self.statistics:
            check_choice(name, "a statistic", (*STATISTICS, "slope"))
        if not 0 < len(set(self.statistics)) == len(self.statistics):
            raise ValueError(f"statistics must contain each name once, got {self.statistics}.")

    def _feature_names(self) -> list[str]:
        return list(self.statistics)

    def _features(self, strokes: Sequence[StrokeSignal]) -> list[float]:
        signals = [stroke.signal for stroke in strokes]
        turns = [stroke.travel / (2 * np.pi) for stroke in strokes]
        pooled = np.concatenate(signals)
        return [
            common_slope(signals, turns) if name == "slope" else STATISTICS[name](pooled)
            for name in self.statistics
        ]


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
        raise ValueError("a slope needs two angles. Leave 'slope' out, or use longer strokes.")
    return products / squares


def _rms(x: Array) -> Array:
    return np.sqrt(np.mean(np.square(x, dtype=np.float64)))


def _peak(x: Array) -> Array:
    return np.abs(x).max()


def _crest_factor(x: Array) -> Array:
    if not _peak(x) > 0:
        raise ValueError("zeros have no crest factor. Leave 'crest_factor' or the channel out.")
    return _peak(x) / _rms(x)


def _moment(x: Array, name: str, power: int) -> float:
    """Return a central moment of the standardised signal; that of a constant is an error."""
    # Samples of a constant signal differ by eight rounding errors at most.
    if np.ptp(x) <= 8 * np.finfo(x.dtype).eps * _peak(x):
        raise ValueError(
            f"the {name} of a constant signal is undefined. Leave {name!r} or the channel out."
        )
    return normalized_moment(x, power)


def normalized_moment(signal: Array, order: int, *, least: float = 0.0) -> float:
    """Return a central moment over that power of the standard deviation, which is at least `least`.

    Of order 4 it is the kurtosis. Applied to the difference signal of a gear, which is noise
    without a fault, 4 gives FM4 and 6 gives M6A [1]_: 3 and 15 then.

    References
    ----------
    .. [1] Martin, Statistical moment analysis as a means of surface damage detection, Proc. 7th
       International Modal Analysis Conference (IMAC), pp. 1016-1021 (1989).

    Examples
    --------
    >>> normalized_moment(np.array([1.0, -1.0, 1.0, -1.0]), 4)
    1.0
    """
    values = np.asarray(signal, dtype=np.float64)
    centred = values - values.mean()
    return float(np.mean((centred / max(_rms(centred), least)) ** order))


STATISTICS: dict[str, Callable[..., Any]] = {
    "mean": partial(np.mean, dtype=np.float64),
    "rms": _rms,
    "std": partial(np.std, dtype=np.float64),
    "peak": _peak,
    "peak_to_peak": np.ptp,
    "crest_factor": _crest_factor,
    "kurtosis": partial(_moment, name="kurtosis", power=4),
    "skewness": partial(_moment, name="skewness", power=3),
}
