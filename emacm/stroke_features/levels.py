"""Level and shape of a signal: mean, RMS, peak, crest factor, kurtosis, slope."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_finite, check_real_array

__all__ = ["STATISTICS", "common_slope", "signal_statistics"]

Array = NDArray[np.float64]

_ROUNDING = 8  # last digits by which samples of a constant may differ


def signal_statistics(signal: ArrayLike, statistics: Sequence[str]) -> Array:
    """Describe the level and the shape of signals.

    Parameters
    ----------
    signal : array-like of shape (..., n_samples)
        Signals in any unit U, at any samples; each sample counts alike.
    statistics : sequence of str
        Any of

        - "mean" [U], "rms" [U], "std" [U] (divided by n_samples, so that
          rms² = mean² + std²),
        - "peak" [U], the largest size, and "peak_to_peak" [U],
        - "crest_factor", peak / rms: 1 of a constant, sqrt(2) of a sine,
        - "kurtosis", the fourth central moment over the squared variance, not less 3:
          1.5 of a sine, 3 of Gaussian noise,
        - "skewness", the third central moment over the variance to the power 3/2.

    Returns
    -------
    ndarray of shape (..., n_statistics)
        In float64, in the order of `statistics`.

    Raises
    ------
    TypeError
        If the signal is not numeric.
    ValueError
        If a statistic is unknown, a sample is not finite, or a ratio is asked of a signal
        that has none: the kurtosis or skewness of a constant, the crest factor of zeros.

    Examples
    --------
    >>> sine = np.sin(2 * np.pi * np.arange(100) / 100)
    >>> signal_statistics(sine, ["rms", "crest_factor", "kurtosis"]).round(3).tolist()
    [0.707, 1.414, 1.5]
    """
    x = check_real_array(signal, "signal")
    if x.ndim == 0 or x.shape[-1] == 0:
        raise ValueError(f"signal must hold at least 1 sample, got shape {x.shape}.")
    check_finite(x.reshape(-1), "signal")
    check_statistics(statistics, "statistics", tuple(STATISTICS))
    return np.stack([STATISTICS[name](x) for name in statistics], axis=-1)


def common_slope(signals: Sequence[ArrayLike], turns: Sequence[ArrayLike]) -> float:
    """Fit one slope to several stretches of a signal, each with a level of its own.

    Parameters
    ----------
    signals : sequence of array-like of shape (n_samples,)
        Stretches of the signal, in any unit U; they may be unequally long.
    turns : sequence of array-like of shape (n_samples,)
        Where each sample stands [revolutions, or any unit].

    Returns
    -------
    float
        Least-squares slope [U per unit of `turns`].

    Raises
    ------
    ValueError
        If no stretch holds samples at two different places, or lengths differ.

    Notes
    -----
    The least-squares solution of ``signal[i] = level[i] + slope * turns[i]`` is the sum of the
    centred products over the sum of the centred squares (assumed: no source is followed).

    Examples
    --------
    >>> round(common_slope([[0.0, 1.0, 2.0], [9.0, 10.0]], [[0, 1, 2], [5, 6]]), 12)
    1.0
    """
    products = squares = 0.0
    for signal, place in zip(signals, turns, strict=True):
        x, t = (np.asarray(values, dtype=np.float64) for values in (signal, place))
        if x.ndim != 1 or x.shape != t.shape:
            raise ValueError(f"a signal of shape {x.shape} does not fit turns of shape {t.shape}.")
        centred = t - t.mean()
        products += float(centred @ (x - x.mean()))
        squares += float(centred @ centred)
    if not squares > 0:
        raise ValueError(
            "a slope needs samples at two angles at the least. Leave 'slope' out, or use longer "
            "strokes."
        )
    return products / squares


def check_statistics(names: Any, parameter: str, known: Sequence[str]) -> tuple[str, ...]:
    """Return names of statistics as a tuple, or say which of them is unknown or comes twice."""
    if isinstance(names, str) or not isinstance(names, Sequence | np.ndarray):
        raise TypeError(f"{parameter} must be a list of names such as ['rms'], got {names!r}.")
    chosen = tuple(names)
    for name in chosen:
        if name not in known:
            raise ValueError(f"{parameter} must be some of {list(known)}; got {name!r}.")
    if not chosen or len(set(chosen)) < len(chosen):
        raise ValueError(f"{parameter} must name each statistic once, got {list(chosen)}.")
    return chosen


def _mean(x: NDArray[np.floating]) -> Array:
    return np.mean(x, axis=-1, dtype=np.float64)


def _peak(x: NDArray[np.floating]) -> Array:
    return np.maximum(np.max(x, axis=-1), -np.min(x, axis=-1)).astype(np.float64)


def _peak_to_peak(x: NDArray[np.floating]) -> Array:
    return np.max(x, axis=-1).astype(np.float64) - np.min(x, axis=-1)


def _rms(x: NDArray[np.floating]) -> Array:
    return _size(np.asarray(x, dtype=np.float64))


def _std(x: NDArray[np.floating]) -> Array:
    return _size(_centred(x))


def _crest_factor(x: NDArray[np.floating]) -> Array:
    peak = _peak(x)
    if not np.all(peak > 0):
        raise ValueError(
            "a signal that is 0 throughout has no crest factor. Leave 'crest_factor' or the "
            "channel out."
        )
    return peak / _rms(x)


def _kurtosis(x: NDArray[np.floating]) -> Array:
    return np.mean(_standardised(x, "kurtosis") ** 4, axis=-1)


def _skewness(x: NDArray[np.floating]) -> Array:
    return np.mean(_standardised(x, "skewness") ** 3, axis=-1)


def _centred(x: NDArray[np.floating]) -> Array:
    return np.asarray(x, dtype=np.float64) - _mean(x)[..., np.newaxis]


def _size(x: Array) -> Array:
    """Root of the mean square, of signals however small or large."""
    largest = np.max(np.abs(x), axis=-1, keepdims=True)
    unit = np.where(largest > 0, largest, 1.0)
    return unit[..., 0] * np.sqrt(np.mean((x / unit) ** 2, axis=-1))


def _standardised(x: NDArray[np.floating], name: str) -> Array:
    """Bring to mean 0 and standard deviation 1; refuse a constant, up to its rounding."""
    if np.any(_peak_to_peak(x) <= _ROUNDING * np.finfo(x.dtype).eps * _peak(x)):
        raise ValueError(f"a constant has no {name}. Leave {name!r} or the channel out.")
    centred = _centred(x)
    return centred / _size(centred)[..., np.newaxis]


STATISTICS: dict[str, Callable[[NDArray[np.floating]], Array]] = {
    "mean": _mean,
    "rms": _rms,
    "std": _std,
    "peak": _peak,
    "peak_to_peak": _peak_to_peak,
    "crest_factor": _crest_factor,
    "kurtosis": _kurtosis,
    "skewness": _skewness,
}
