"""From uniform time to uniform shaft angle.

Two ways are given. `interpolate_to_angle` reads the signal off between its time
samples, as the thesis does (Chirico, Eq. (2.13)); whatever the angle grid cannot
hold folds into its orders. `spread_to_angle` is band-limited (see `emacm.resampling.spreading`).
Both work through the signal in blocks; `angle_blocks` hands them on as they come.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_choice, check_finite, check_number, check_real_array
from emacm.resampling.interpolation import INTERPOLATIONS, interpolated
from emacm.resampling.spreading import PASS, spread_rows
from emacm.shaft.motion import Series
from emacm.shaft.paths import ShaftPath

__all__ = [
    "INTERPOLATIONS",
    "PASS",
    "angle_blocks",
    "angle_count",
    "interpolate_to_angle",
    "spread_to_angle",
]


def angle_count(path: ShaftPath, theta_s: float) -> int:
    """Return how many samples `theta_s` [rad] apart the path holds, its start included."""
    return path.count(theta_s)


def angle_blocks(
    rows: Sequence[Series],
    fs: float,
    path: ShaftPath,
    *,
    theta_s: float,
    antialias: bool = True,
    interpolation: str = "cubic",
) -> Iterator[NDArray[np.floating]]:
    """Resample signals of any length, a block at a time.

    Parameters
    ----------
    rows : sequence of ndarray of shape (n_times,), or of what slices like one
        Finite signals at times ``n / fs``, equally long; they may be memory maps.
    fs : float
        Their sampling rate [Hz].
    path : ShaftPath
        Way of the shaft.
    theta_s : float
        Angle between samples of the result [rad].
    antialias : bool
        As `spread_to_angle` does it, or as `interpolate_to_angle`.
    interpolation : {"linear", "cubic"}
        Used where `antialias` is False.

    Returns
    -------
    iterator of ndarray of shape (n_rows, n_angles)
        Blocks of at most some hundred thousand samples, in order; float32 if all rows are.
    """
    if antialias:
        return spread_rows(rows, fs, path, theta_s)
    return interpolated(rows, fs, path, theta_s, interpolation)


def interpolate_to_angle(
    signal: ArrayLike,
    fs: float,
    path: ShaftPath,
    *,
    theta_s: float,
    interpolation: str = "linear",
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Resample by interpolation between time samples, without a filter.

    Parameters
    ----------
    signal : array-like of shape (..., n_times), or list of ndarray of shape (n_times,)
        Signal at times ``n / fs``, in any unit; a list of float arrays is taken as finite.
    fs : float
        Its sampling rate [Hz].
    path : ShaftPath
        Way of the shaft.
    theta_s : float
        Angle between samples of the result [rad].
    interpolation : {"linear", "cubic"}
        "linear" is Eq. (2.13) of Chirico, read from x(k-1); it loses 1.8 dB at
        four time samples per cycle. "cubic" is a cubic spline over time.

    Returns
    -------
    angles : ndarray of shape (n_angles,)
        Angle run from the start of the path [rad].
    resampled : ndarray of shape (..., n_angles)
        Signal at these angles; float32 stays float32.

    Raises
    ------
    TypeError, ValueError
        If `interpolation` is neither, `theta_s` or `fs` not positive, or the
        signal not finite.
    """
    check_choice(interpolation, "interpolation", INTERPOLATIONS)
    return _resampled(signal, fs, path, theta_s, antialias=False, interpolation=interpolation)


def spread_to_angle(
    signal: ArrayLike, fs: float, path: ShaftPath, *, theta_s: float
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Resample with the orders limited to what the angle grid holds.

    Flat within 0.01 dB up to 0.78 of the highest order π/theta_s, and up to
    0.84 of half the sampling rate; what would fold into the flat band is down
    by more than 60 dB at every speed. Beyond the ends of the stroke the signal is
    taken as its own mirror image: its mean has no edge there, but the first and last
    ten samples err (a tone at a tenth of the highest order by up to 6 %, one near
    the highest by more than half).

    Parameters
    ----------
    signal : array-like of shape (..., n_times), or list of ndarray of shape (n_times,)
        Signal at times ``n / fs``, in any unit; a list of float arrays is taken as finite.
    fs : float
        Its sampling rate [Hz].
    path : ShaftPath
        Way of the shaft.
    theta_s : float
        Angle between samples of the result [rad].

    Returns
    -------
    angles : ndarray of shape (n_angles,)
        Angle run from the start of the path [rad].
    resampled : ndarray of shape (..., n_angles)
        Signal at these angles; float32 stays float32.

    Raises
    ------
    TypeError, ValueError
        If `theta_s` or `fs` is not positive, the signal not finite, or if the
        shaft jumps (the message says when).
    """
    return _resampled(signal, fs, path, theta_s, antialias=True)


def _resampled(
    signal: Any, fs: float, path: ShaftPath, theta_s: float, **options: Any
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    rows, leading = _as_rows(signal)
    fs = check_number(fs, "fs", above=0, unit="Hz")
    angles = theta_s * np.arange(path.count(theta_s))
    resampled = np.empty((len(rows), len(angles)), np.result_type(*rows))
    done = 0
    for block in angle_blocks(rows, fs, path, theta_s=theta_s, **options):
        resampled[:, done : done + block.shape[1]] = block
        done += block.shape[1]
    return angles, resampled.reshape(*leading, len(angles))


def _as_rows(signal: Any) -> tuple[Sequence[NDArray[np.floating]], tuple[int, ...]]:
    """Return 1-D signals and the shape they stood in; a list of arrays is not copied."""
    if isinstance(signal, list) and all(map(_is_float_row, signal)) and signal:
        if len({len(row) for row in signal}) > 1:
            raise ValueError("signals resampled together must have the same length.")
        return signal, (len(signal),)
    array = check_real_array(signal, "signal")
    if array.ndim == 0 or array.size == 0 or array.shape[-1] < 2:
        raise ValueError(f"signal must hold at least 2 samples, got shape {array.shape}.")
    check_finite(array.reshape(-1), "signal")
    return list(array.reshape(-1, array.shape[-1])), array.shape[:-1]


def _is_float_row(row: Any) -> bool:
    """Tell whether this is a channel as `Recording` holds it, and has checked it."""
    return isinstance(row, np.ndarray) and row.ndim == 1 and row.dtype.kind == "f" and len(row) > 1
