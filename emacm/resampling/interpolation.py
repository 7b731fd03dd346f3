"""Interpolation of a signal between its time samples, without a filter, as in the thesis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import ModuleType

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from emacm import _kernels
from emacm.shaft.motion import Series, parts
from emacm.shaft.paths import ShaftPath

INTERPOLATIONS = ("linear", "cubic")

_SPLINE_BLOCK = 1 << 15  # samples in work at once; a spline needs ten times their memory
_SPLINE_MARGIN = 48  # samples; a spline forgets what lies n samples away like 0.27**n


def interpolated(
    rows: Sequence[Series],
    fs: float,
    path: ShaftPath,
    theta_s: float,
    interpolation: str,
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
    at_once = loops.READ_BLOCK if interpolation == "linear" else _SPLINE_BLOCK
    # Less at once where the angle grid is dense, so that it takes no more memory than the signals.
    at_once = max(2, int(at_once / max(1.0, path.fastest / (fs * theta_s))))
    for start, stop in parts(first, last - 1, at_once):
        stop += 1  # the sample that the next part begins with
        travel = path.travel_at(fs, start, stop)
        # A shaft that stands or shivers repeats angles; what counts is when it passes them for
        # good.
        if path.max_reversal:
            travel = np.maximum(np.maximum.accumulate(travel), farthest)
        farthest = float(travel[-1])
        end = n_angles if stop == last else min(_passed(farthest, theta_s), n_angles)
        if end <= done:
            continue
        read = [
            _read_off(loops, rows, start, stop, travel, done, end - done, theta_s, interpolation)
        ]
        del travel  # what is not needed any more is gone before the next is made
        yield read.pop()
        done = end


def _read_off(
    loops: ModuleType,
    rows: Sequence[Series],
    start: int,
    stop: int,
    travel: NDArray[np.floating],
    first: int,
    n_angles: int,
    theta_s: float,
    interpolation: str,
) -> NDArray[np.floating]:
    """Read the rows off at some grid angles that lie between their samples `start` and `stop`."""
    values = np.empty((len(rows), n_angles))
    if interpolation == "linear":
        parts_of_rows = [row[start:stop] for row in rows]
        loops.interpolate_linear(travel, first, theta_s, parts_of_rows, values)
        return values
    left, weights = loops.interpolation_weights(travel, first, n_angles, theta_s)
    for value, row in zip(values, rows, strict=True):
        value[:] = _spline(row, start, stop, left + weights)
    return values


def _passed(angle: float, theta_s: float) -> int:
    """Count the grid angles below `angle`."""
    count = int(np.ceil(angle / theta_s))
    while count > 0 and theta_s * (count - 1) >= angle:
        count -= 1
    while theta_s * count < angle:
        count += 1
    return count


def _spline(
    row: Series, start: int, stop: int, indices: NDArray[np.floating]
) -> NDArray[np.floating]:
    """Read a cubic spline off at fractional indices counted from `start`."""
    low, high = max(0, start - _SPLINE_MARGIN), min(len(row), stop + _SPLINE_MARGIN)
    near = row[low:high].astype(np.float64)
    spline = make_interp_spline(np.arange(len(near)), near, k=min(3, len(near) - 1))
    return spline(indices + (start - low))
