"""From uniform time to uniform shaft angle.

Two ways are given. `interpolate_to_angle` reads the signal off between its time
samples, as the thesis does (Chirico, Eq. (2.13)); whatever the angle grid cannot
hold folds into its orders. `spread_to_angle` is band-limited. It computes

    y(a) = integral x(s) K(a - s) ds = sum_n x_n K(a - s_n) ds_n

where s is the angle run along the stroke and K a low-pass filter over angle. The
sum over time samples is exact as long as x(t) K(a - s(t)) holds nothing above the
sampling rate, so there is no interpolation loss, and the filter follows the
speed by itself. K is done in two steps, which is the gridding of a non-uniform
Fourier transform (Barnett, Magland and af Klinteberg, SIAM J. Sci. Comput. 41(5),
2019, for the kernel): each time sample is spread over the four nearest points of
a grid twice as fine, and a short filter evens the kernel out, cuts off, and keeps
every other point. Where the time samples are too sparse for the sum to be exact,
they are first made denser by band-limited interpolation at uniform times.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import signal as filters
from scipy import sparse
from scipy.interpolate import make_interp_spline

from emacm._checks import check_choice, check_finite, check_number, check_real_array
from emacm.strokes import Path

INTERPOLATIONS = ("linear", "cubic")

# All measured by the tests: pass band within 0.01 dB to PASS of the highest order, and whatever
# folds into it down by more than 60 dB.
PASS = 0.78  # of the highest order pi/theta_s: how far the band-limited result is flat
_WIDTH = 4  # grid points over which a time sample is spread
_SHAPE = 2.4 * _WIDTH  # of the kernel exp(shape (sqrt(1 - z²) - 1)); least folding at this grid
_HALF = 20  # of the decimating filter, in points of the fine grid
_MARGIN = _HALF + _WIDTH // 2  # fine grid points needed beyond either end of the stroke
_KERNEL_REACH = 4 - PASS  # highest order the kernel still lets through, per pi/theta_s
_UPSAMPLING_HALF = 16  # time samples on either side that a new sample is made from
_UPSAMPLING_STOP = 0.58  # of fs: where the filter of the time interpolation has fallen by 80 dB
_BLOCK = 1 << 15  # time samples in work at once
_MOST_DENSER = 64  # times the samples there are over time and angle; beyond, the shaft jumps
_MOST_SAMPLES = 1 << 27  # of one channel, over the angle or in work over time


def angle_count(path: Path, theta_s: float) -> int:
    """Return how many samples `theta_s` [rad] apart the path holds, its start included."""
    theta_s = check_number(theta_s, "theta_s", above=0, unit="rad per sample")
    count = path.length / theta_s + 1e-9
    if count > _MOST_SAMPLES:
        raise ValueError(
            f"theta_s = {theta_s:g} rad would make {count:.3g} samples of a stroke of "
            f"{path.length / (2 * np.pi):.3g} revolutions. It is the angle between samples, "
            f"such as 2 * np.pi / 128."
        )
    return int(count) + 1


def interpolate_to_angle(
    signal: ArrayLike,
    fs: float,
    path: Path,
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
    path : Path
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
        Signal at these angles.

    Raises
    ------
    TypeError, ValueError
        If `interpolation` is neither, `theta_s` or `fs` not positive, or the
        signal not finite.
    """
    check_choice(interpolation, "interpolation", INTERPOLATIONS)
    rows, leading = _as_rows(signal)
    fs = check_number(fs, "fs", above=0, unit="Hz")
    angles = theta_s * np.arange(angle_count(path, theta_s))
    first, last = _sample_range(path, fs, len(rows[0]))
    travel = _travel_at(path, np.arange(first, last) / fs)
    # A shaft that stands or shivers repeats angles; what counts is when it passes them for good.
    index = np.interp(angles, np.maximum.accumulate(travel), np.arange(len(travel)))
    values = np.stack([_read_off(row[first:last], index, interpolation) for row in rows])
    return angles, values.reshape(*leading, len(angles))


def spread_to_angle(
    signal: ArrayLike, fs: float, path: Path, *, theta_s: float
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
    path : Path
        Way of the shaft.
    theta_s : float
        Angle between samples of the result [rad].

    Returns
    -------
    angles : ndarray of shape (n_angles,)
        Angle run from the start of the path [rad].
    resampled : ndarray of shape (..., n_angles)
        Signal at these angles.

    Raises
    ------
    TypeError, ValueError
        If `theta_s` or `fs` is not positive, the signal not finite, or if the
        shaft jumps (the message says when).
    """
    rows, leading = _as_rows(signal)
    fs = check_number(fs, "fs", above=0, unit="Hz")
    angles = theta_s * np.arange(angle_count(path, theta_s))
    # The mean is set aside, so that it comes out exact whatever the ripple of the filter.
    first, last = _sample_range(path, fs, len(rows[0]))
    means = np.array([row[first:last].mean(dtype=np.float64) for row in rows])
    step = theta_s / 2
    if path.length < step:  # too short to hold more than its mean
        return angles, np.repeat(means, len(angles)).reshape(*leading, len(angles))
    grid = _FineGrid(len(rows), len(angles))
    # What the shaft may still turn back: the grid behind that is done.
    shiver = float(np.max(np.maximum.accumulate(path.travel) - path.travel))
    for travel, weight, values in _dense_blocks(rows, fs, path, theta_s):
        for image in _mirror_images(travel, path.length, _MARGIN * step):
            grid.spread(image / step + _MARGIN, weight / step, values - means)
        reached = (float(travel.max()) - shiver) / step
        if reached > _MARGIN:  # samples to come have no mirror image at the start any more
            grid.finish(int(reached))
    resampled = grid.finished()
    resampled += means[:, np.newaxis]
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


def _sample_range(path: Path, fs: float, n_times: int) -> tuple[int, int]:
    """First and last + 1 of the samples at rate `fs` that lie on the path."""
    end_time = path.start_time + (len(path.travel) - 1) / path.fs
    first = int(np.ceil(path.start_time * fs - 1e-6))
    last = min(n_times, int(np.floor(end_time * fs + 1e-6)) + 1)
    if last - first < 2:
        # A path shorter than a sampling interval: the two samples around it hold all there is.
        first = max(0, min(first, n_times - 2))
        last = first + 2
    return first, last


def _travel_at(path: Path, times: NDArray[np.floating]) -> NDArray[np.floating]:
    """Angle run at any times, by the cubic through the four samples around each."""
    position = (times - path.start_time) * path.fs
    nearest = np.rint(position)
    last = len(path.travel) - 1
    if np.all(np.abs(position - nearest) < 1e-6) and nearest[0] >= 0 and nearest[-1] <= last:
        return path.travel[nearest.astype(np.intp)]
    position = np.clip(position, 0, last)
    if last < 3:
        return np.interp(position, np.arange(last + 1), path.travel)
    left = np.clip(position.astype(np.intp), 1, last - 2)
    u = position - left
    before, here, there, after = (path.travel[left + k] for k in (-1, 0, 1, 2))
    return (
        -u * (u - 1) * (u - 2) / 6 * before
        + (u + 1) * (u - 1) * (u - 2) / 2 * here
        - (u + 1) * u * (u - 2) / 2 * there
        + (u + 1) * u * (u - 1) / 6 * after
    )


def _read_off(
    row: NDArray[np.floating], index: NDArray[np.floating], interpolation: str
) -> NDArray[np.floating]:
    """Value of a signal at fractional sample indices."""
    if interpolation == "linear":
        return np.interp(index, np.arange(len(row)), row)
    degree = min(3, len(row) - 1)
    return make_interp_spline(np.arange(len(row)), row, k=degree)(index)


def _dense_blocks(
    rows: Sequence[NDArray[np.floating]], fs: float, path: Path, theta_s: float
) -> Iterator[tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]]:
    """Yield angle run, its share of the integral, and values, in blocks of dense time samples.

    Shapes are (n,), (n,) and (n, n_rows).
    """
    factor = _upsampling(fs, path, theta_s)
    rate = fs * factor
    # Made denser, the signal goes on, mirrored, to the end of the path.
    n_times = len(rows[0]) if factor == 1 else factor * (len(rows[0]) + 1)
    first, last = _sample_range(path, rate, n_times)
    for start in range(first, last, _BLOCK):
        stop = min(start + _BLOCK, last)
        around = np.arange(max(start - 1, first), min(stop + 1, last))
        travel = _travel_at(path, around / rate)
        # Each sample stands for the way halfway to its neighbours, the outer ones up to the ends.
        halfway = (travel[1:] + travel[:-1]) / 2
        low = [] if start > first else [0.0]
        high = [] if stop < last else [path.length]
        weight = np.diff(np.concatenate([low, halfway, high]))
        inside = slice(start - around[0], start - around[0] + stop - start)
        yield travel[inside], weight, _upsampled(rows, factor, start, stop).T


def _upsampling(fs: float, path: Path, theta_s: float) -> int:
    """How much denser the time samples must be for the sum to stand for the integral."""
    speed = float(np.max(np.abs(np.diff(path.travel)))) * path.fs  # rad/s
    reach = _KERNEL_REACH * speed / (2 * theta_s)  # Hz: the kernel as a function of time
    if reach <= fs / 2:
        return 1
    factor = max(2.0, np.ceil(reach / fs + _UPSAMPLING_STOP))
    n_dense = factor * fs * len(path.travel) / path.fs
    needed = len(path.travel) + len(path.travel) * fs / path.fs + angle_count(path, theta_s)
    if n_dense > _MOST_DENSER * needed:
        steps = np.abs(np.diff(path.travel))
        worst = int(steps.argmax())
        raise ValueError(
            f"the shaft turns by {steps[worst]:.3g} rad within one of its samples, at "
            f"{path.start_time + worst / path.fs:.6g} s; that is {steps[worst] / steps.mean():.3g} "
            f"times its mean step. Is the angle in rad, and is this a jump? Repair or cut it."
        )
    if n_dense > _MOST_SAMPLES:
        raise ValueError(
            f"theta_s = {theta_s:g} rad is too fine for signals at {fs:g} Hz: between two of their "
            f"samples the shaft turns by up to {speed / fs:.3g} rad. Raise theta_s."
        )
    return int(factor)


def _upsampled(
    rows: Sequence[NDArray[np.floating]], factor: int, start: int, stop: int
) -> NDArray[np.floating]:
    """Return samples `start` to `stop` of the rows at `factor` times their rate."""
    if factor == 1:
        return np.stack([row[start:stop] for row in rows])
    low = start // factor - _UPSAMPLING_HALF
    high = -(-stop // factor) + _UPSAMPLING_HALF + 1
    index = np.arange(low, high)
    last = len(rows[0]) - 1
    # Mirrored at the ends of the recording.
    index = np.abs((index + last) % (2 * last) - last)
    sparse_rows = np.stack([row[index] for row in rows])
    dense = filters.upfirdn(_upsampling_filter(factor), sparse_rows, up=factor)
    offset = start - low * factor + _UPSAMPLING_HALF * factor
    return dense[:, offset : offset + stop - start]


def _mirror_images(
    travel: NDArray[np.floating], length: float, margin: float
) -> Iterator[NDArray[np.floating]]:
    """Yield the positions, and their mirror images that lie within the margin of the path."""
    yield travel
    n_images = int(np.ceil(margin / length)) + 1
    for k in range(-n_images, n_images + 1):
        # Mirroring at 0 and at `length`, over and over, leads to 2 k length - travel and, twice
        # mirrored, 2 k length + travel.
        for sign in (-1, 1) if k else (-1,):
            image = 2 * k * length + sign * travel
            if image.max() > -margin and image.min() < length + margin:
                yield image


class _FineGrid:
    """The fine grid, of which only the part in work is held, and what was decimated from it.

    Row `_MARGIN` + 2 j is the angle of output j.
    """

    def __init__(self, n_rows: int, n_angles: int) -> None:
        self._resampled = np.empty((n_rows, n_angles))
        self._done = 0  # outputs
        self._rows = np.zeros((0, n_rows))  # of the grid, from row 2 * self._done upwards
        self._end = 2 * (n_angles - 1) + 1 + 2 * _MARGIN

    def spread(
        self,
        position: NDArray[np.floating],
        weight: NDArray[np.floating],
        values: NDArray[np.floating],
    ) -> None:
        """Add weighted values, each at a fractional row of the grid, to the rows around it."""
        origin = 2 * self._done
        inside = (position >= origin + _WIDTH // 2 - 1) & (position < self._end - _WIDTH // 2)
        if not inside.all():
            position, weight, values = position[inside], weight[inside], values[inside]
        if not len(position):
            return
        first = position.astype(np.intp) - (_WIDTH // 2 - 1)
        rows = first[:, np.newaxis] + np.arange(_WIDTH)
        shares = weight[:, np.newaxis] * _kernel(position[:, np.newaxis] - rows)
        low, high = int(first.min()), int(first.max()) + _WIDTH
        columns = np.arange(0, rows.size + 1, _WIDTH)
        operator = sparse.csc_array(
            (shares.ravel(), (rows - low).ravel(), columns), shape=(high - low, len(position))
        )
        self._reach(high - origin)
        self._rows[low - origin : high - origin] += operator @ values

    def finish(self, row: int) -> None:
        """Decimate as far as the grid below `row` allows, and let go of what is done."""
        # Output j needs the rows from 2 j + _WIDTH / 2 to 2 j + 2 _HALF + _WIDTH / 2.
        ready = (row - 2 * _HALF - _WIDTH // 2) // 2
        count = min(ready, self._resampled.shape[1]) - self._done
        if count <= 0:
            return
        first = _WIDTH // 2
        part = slice(first, first + 2 * (count - 1) + 1 + 2 * _HALF)
        self._reach(part.stop)
        for output, column in zip(self._resampled, self._rows[part].T, strict=True):
            even = filters.upfirdn(_decimating_filter(), column, down=2)
            output[self._done : self._done + count] = even[_HALF : _HALF + count]
        self._done += count
        self._rows = self._rows[2 * count :].copy()

    def finished(self) -> NDArray[np.floating]:
        """Decimate the rest, and return all outputs, shape (n_rows, n_angles)."""
        self.finish(self._end + 2)
        return self._resampled

    def _reach(self, n_rows: int) -> None:
        """Hold at least so many rows."""
        missing = n_rows - len(self._rows)
        if missing > 0:
            more = np.zeros((missing, self._rows.shape[1]))
            self._rows = np.concatenate([self._rows, more])


def _kernel(distance: NDArray[np.floating]) -> NDArray[np.floating]:
    """Exponential of semicircle (Barnett et al., Eq. (1.8)), of distances in grid points."""
    z = distance * (2 / _WIDTH)
    return np.exp(_SHAPE * (np.sqrt(np.maximum(0.0, 1.0 - z * z)) - 1.0))


def _kernel_spectrum(frequency: NDArray[np.floating]) -> NDArray[np.floating]:
    """Fourier transform of the kernel at frequencies in cycles per grid point."""
    node, weight = np.polynomial.legendre.leggauss(100)
    distance = node * _WIDTH / 2
    return np.cos(2 * np.pi * np.outer(frequency, distance)) @ (
        weight * _WIDTH / 2 * _kernel(distance)
    )


@lru_cache(maxsize=1)
def _decimating_filter() -> NDArray[np.floating]:
    """Low pass for keeping every other point of the fine grid, which also evens out the kernel."""
    # Frequencies in units of the fine grid's Nyquist frequency; that of the result is 0.5.
    passed = np.repeat(np.linspace(0, 0.5 * (PASS + 0.02), 41), 2)[1:-1]
    stopped = 0.5 * (2 - PASS - 0.02)
    bands = [*passed, stopped, 1.0]
    gains = [*(1 / _kernel_spectrum(passed / 2)), 0.0, 0.0]
    importance = [1.0] * (len(passed) // 2) + [10.0]
    return filters.firls(2 * _HALF + 1, bands, gains, weight=importance)


@lru_cache(maxsize=32)
def _upsampling_filter(factor: int) -> NDArray[np.floating]:
    """Low pass at the old Nyquist frequency; Kaiser's window for 80 dB."""
    taps = 2 * _UPSAMPLING_HALF * factor + 1
    return factor * filters.firwin(taps, 1 / factor, window=("kaiser", filters.kaiser_beta(80)))
