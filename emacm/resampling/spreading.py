"""Band-limited resampling: time samples are spread over the angle grid (gridding).

The result is

    y(a) = integral x(s) K(a - s) ds = sum_n x_n K(a - s_n) ds_n

where s is the angle travelled along the stroke and K a low-pass filter over angle. The sum over
time samples is exact as long as x(t) K(a - s(t)) holds nothing above the sampling rate, so there is
no interpolation loss, and the cut-off frequency of the filter follows the speed. K is applied in
two steps, as in the gridding of a type-1 non-uniform Fourier transform (Barnett, Magland and af
Klinteberg, SIAM J. Sci. Comput. 41(5), 2019, for the kernel): each time sample is spread over the
four nearest points of a grid twice as fine, and a short filter corrects for the kernel, limits the
band, and keeps every other point. Where the time samples are too sparse for the sum to be exact,
they are first upsampled by band-limited interpolation at uniform times.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from types import ModuleType
from typing import NamedTuple

import numpy as np
import scipy  # which imports scipy.signal, a tenth of a second, when it is used
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from emacm._kernels import kernels
from emacm.shaft.motion import LazySeries, Series, parts
from emacm.shaft.paths import ShaftPath

# All measured by the tests: pass band within 0.01 dB to PASS of the highest order, and whatever
# folds into it down by more than 60 dB.
PASS = 0.78  # of the highest order pi/theta_s: how far the band-limited result is flat
_WIDTH = 4  # grid points over which a time sample is spread
_SHAPE = 2.4 * _WIDTH  # of the kernel exp(shape (sqrt(1 - z²) - 1)); least folding at this grid
_DEGREE = 5  # of the polynomials that stand for the kernel: within 1e-4 of it
_HALF = 20  # of the decimating filter, in points of the fine grid
_FIRST = _WIDTH // 2  # point that the filter of the first output reads first
_MARGIN = _HALF + _FIRST  # fine grid points needed beyond either end of the stroke
_KERNEL_REACH = 4 - PASS  # highest order the kernel still lets through, per pi/theta_s
_UPSAMPLING_HALF = 16  # time samples on either side that a new sample is made from
_UPSAMPLING_STOP = 0.58  # of fs: where the filter of the time interpolation has fallen by 80 dB
_MOST_DENSER = 64  # times the samples there are over time and angle; beyond, the shaft jumps
_MOST_SAMPLES = 1 << 31  # in work over time
_MEAN_OF, _MEAN_BELOW = 96, 5000  # samples that a mean is taken of, of a signal that is longer


def spread_rows(
    rows: Sequence[Series], fs: float, path: ShaftPath, theta_s: float
) -> Iterator[NDArray[np.floating]]:
    """Yield the rows at the grid angles, limited to the orders that the grid can represent.

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

    Yields
    ------
    ndarray of shape (n_rows, n_angles)
        The next angles; all blocks together cover the whole path.
    """
    n_angles = path.count(theta_s)
    first, last = path.sample_range(fs, len(rows[0]))
    # Set aside, so that a large offset comes out exact whatever the ripple of the filter.
    means = _means(rows, first, last)
    if path.length < theta_s / 2:  # too short to hold more than its mean
        yield np.repeat(means, n_angles).reshape(len(rows), n_angles)
        return
    loops = kernels()
    grid = _FineGrid(loops, path, means, n_angles, theta_s)
    for block in _dense_blocks(loops, rows, fs, path, theta_s, (first, last)):
        resampled = [grid.resample(block)]
        del block  # what is not needed any more is gone before the next is made
        if resampled[0].shape[1]:
            yield resampled.pop()


def _means(rows: Sequence[Series], first: int, last: int) -> NDArray[np.floating]:
    """Mean of each signal, or of some of its samples where it is long: close, at no cost."""
    stride = max(1, (last - first) // _MEAN_OF) if last - first > _MEAN_BELOW else 1
    soon = min(last, first + _MEAN_BELOW)
    # Samples of a computed signal that lie far apart may cost as much as the whole of it.
    read = (
        row[first:soon] if isinstance(row, LazySeries) else row[first:last:stride] for row in rows
    )
    return np.array([part.mean(dtype=np.float64) for part in read])


class _Block(NamedTuple):
    """Dense time samples.

    Attributes
    ----------
    travel : ndarray of shape (n,)
        Angle travelled [rad].
    ends : (float, float)
        That of the samples before and after them.
    values : list of ndarray of shape (n,)
        Of each row.
    last : bool
        Whether it is the last block.
    """

    travel: NDArray[np.floating]
    ends: tuple[float, float]
    values: list[NDArray[np.floating]]
    last: bool

    def cut(self, first: int, last: int) -> _Block:
        """Return the samples `first` to `last` (exclusive)."""
        before = float(self.travel[first - 1]) if first else self.ends[0]
        after = float(self.travel[last]) if last < len(self.travel) else self.ends[1]
        values = [row[first:last] for row in self.values]
        return _Block(self.travel[first:last], (before, after), values, self.last)


def _dense_blocks(
    loops: ModuleType,
    rows: Sequence[Series],
    fs: float,
    path: ShaftPath,
    theta_s: float,
    sample_range: tuple[int, int],
) -> Iterator[_Block]:
    """Yield dense time samples in blocks."""
    factor = _upsampling(fs, path, theta_s)
    rate, (first, last) = fs * factor, sample_range
    if factor > 1:  # at the higher rate, the signal continues, mirrored, to the end of the path
        first, last = path.sample_range(rate, factor * (len(rows[0]) + 1))
    # Less at once where the angle grid is dense, so that it takes no more memory than the signals.
    density = 2 * path.fastest / (rate * theta_s)  # points of the fine grid for each sample
    at_once = max(1, int(loops.BLOCK / max(1.0, 2 * density)))
    for start, stop in parts(first, last, at_once):
        low, high = max(start - 1, first), min(stop + 1, last)
        travel = path.travel_at(rate, low, high)
        # Each sample stands for the way halfway to its neighbours, the outer ones up to the ends:
        # their neighbours beyond are their mirror images.
        before = travel[0] if low < start else -travel[0]
        after = travel[-1] if high > stop else 2 * path.length - travel[-1]
        if factor == 1:
            values = [row[start:stop] for row in rows]
        else:
            values = _upsampled(loops, rows, factor, start, stop)
        travel = travel[start - low : len(travel) - (high - stop)]
        made = [_Block(travel, (float(before), float(after)), values, stop == last)]
        del travel, values
        yield made.pop()


def _upsampling(fs: float, path: ShaftPath, theta_s: float) -> int:
    """How much denser the time samples must be for the sum to stand for the integral."""
    reach = _KERNEL_REACH * path.fastest / (2 * theta_s)  # Hz: the kernel as a function of time
    if reach <= fs / 2:
        return 1
    factor = max(2.0, np.ceil(reach / fs + _UPSAMPLING_STOP))
    n_shaft = len(path.travel)
    n_dense = factor * fs * n_shaft / path.fs
    if n_dense > _MOST_DENSER * (n_shaft + n_shaft * fs / path.fs + path.count(theta_s)):
        largest, place = path.largest_step()
        mean = path.length / (n_shaft - 1)
        raise ValueError(
            f"the shaft turns by {largest:.3g} rad within one of its samples, at "
            f"{path.start_time + place / path.fs:.6g} s; that is {largest / mean:.3g} "
            f"times its mean step. Is the angle in rad, and is this a jump? Repair or cut it."
        )
    if n_dense > _MOST_SAMPLES:
        raise ValueError(
            f"theta_s = {theta_s:g} rad is too fine for signals at {fs:g} Hz: between two of their "
            f"samples the shaft turns by up to {path.fastest / fs:.3g} rad. Raise theta_s."
        )
    return int(factor)


def _upsampled(
    loops: ModuleType, rows: Sequence[Series], factor: int, start: int, stop: int
) -> list[NDArray[np.floating]]:
    """Return samples `start` to `stop` of the rows at `factor` times their rate."""
    low = start // factor - _UPSAMPLING_HALF
    high = -(-stop // factor) + _UPSAMPLING_HALF + 1
    last = len(rows[0]) - 1
    first, count = start - low * factor, stop - start
    taps = _upsampling_filter(factor)
    if low >= 0 and high <= last + 1:
        parts = [row[low:high] for row in rows]
    else:  # mirrored at the ends of the recording
        index = np.abs((np.arange(low, high) + last) % (2 * last) - last)
        parts = [row[index] for row in rows]
    return [loops.upsample(part, taps, factor, first, count) for part in parts]


def _range(travel: NDArray[np.floating], *, monotonic: bool) -> tuple[float, float]:
    """Least and greatest of the angles."""
    if monotonic:
        return float(travel[0]), float(travel[-1])
    return float(travel.min()), float(travel.max())


def _mirror_images(
    low: float, high: float, length: float, margin: float
) -> Iterator[tuple[int, float]]:
    """Yield sign and shift of those mirror images of angles `low` to `high` that are near the path.

    Mirroring at 0 and at `length`, over and over, leads to 2 k length - travel and, twice
    mirrored, to 2 k length + travel.
    """
    if low > margin and high < length - margin:
        return
    n_images = int(np.ceil(margin / length)) + 1
    for k in range(-n_images, n_images + 1):
        for sign in (-1, 1) if k else (-1,):
            ends = sorted((2 * k * length + sign * low, 2 * k * length + sign * high))
            if ends[1] > -margin and ends[0] < length + margin:
                yield sign, 2 * k * length


class _FineGrid:
    """The fine grid, of which only the part in work is held.

    Point `_MARGIN` + 2 j is the angle of output j.
    """

    def __init__(
        self,
        loops: ModuleType,
        path: ShaftPath,
        means: NDArray[np.floating],
        n_angles: int,
        theta_s: float,
    ) -> None:
        self._loops = loops
        self._means = means
        self._step = theta_s / 2
        self._length = path.length
        self._monotonic = path.max_reversal == 0
        # So far behind the farthest sample an output may stand: what the shaft may still turn back,
        # and as much again, as a shaft that went beyond its end is mirrored back from there; the
        # filter; as much as mirror images reach over the ends; and a point, for rounding.
        self._lag = 2 * path.max_reversal / self._step + _MARGIN + 2 * _HALF + _FIRST + 1
        self._end = 2 * (n_angles - 1) + 1 + 2 * _MARGIN
        self._n_angles = n_angles
        self._done = 0  # outputs
        self._used = 0  # points held, from point 2 * self._done upwards
        self._grid = np.zeros((len(means), 0))

    def resample(self, block: _Block) -> NDArray[np.floating]:
        """Spread a block of samples, and return the outputs that the grid allows."""
        low, high = _range(block.travel, monotonic=self._monotonic)
        images = list(_mirror_images(low, high, self._length, _MARGIN * self._step))
        # Outputs are made as the samples go by, so what the start is mirrored to comes before, and
        # what the end is mirrored to, of which nothing is read until then, comes after.
        for sign, shift in images:
            if shift <= 0:
                self._spread_image(block, sign, shift, low, high)
        offset, ready = self._offset, self._n_angles - self._done
        if not block.last:
            complete = high / self._step + offset - self._lag
            ready = max(0, min(ready, int(complete // 2)))
        outputs = np.empty((len(block.values), ready))
        done = self._resample_parts(block, outputs)
        for sign, shift in images:
            if shift > 0:
                self._spread_image(block, sign, shift, low, high)
        if done < ready:
            self._reach(_FIRST + 2 * (ready - done - 1) + 1 + 2 * _HALF)
            self._decimate(outputs, done, ready - done)
        return outputs

    def _resample_parts(self, block: _Block, outputs: NDArray[np.floating]) -> int:
        """Spread the samples, and decimate what is complete; return how many outputs are made."""
        scale, offset, done, n_times = 1 / self._step, self._offset, 0, len(block.travel)
        top, span = offset, abs(float(block.travel[-1] - block.travel[0])) * scale
        # The points of a part should stay in the processor's cache.
        at_once = max(1, int(self._loops.PART * min(1.0, n_times / span if span else 1.0)))
        for start in range(0, n_times, at_once):
            part = block.cut(start, min(start + at_once, n_times))
            top = max(top, float(part.travel.max()) * scale + offset)
            self._reach(int(top) - 2 * done + 3)
            place, grid = (scale, offset - 2 * done, _kernel_halves()), (self._grid, self._used)
            self._loops.spread(part.travel, part.ends, *place, part.values, self._means, *grid)
            ready = min(int((top - self._lag) // 2), outputs.shape[1]) - done
            if ready > 0:
                self._decimate(outputs, done, ready)
                done += ready
        return done

    def _decimate(self, outputs: NDArray[np.floating], done: int, n_outputs: int) -> None:
        """Fill some outputs, and drop the points that are not needed any more."""
        taps, grid = _decimating_filter(), (self._grid, self._used, _FIRST)
        self._loops.decimate(*grid, taps, self._means, outputs, done, n_outputs)
        self._done, self._used = self._done + n_outputs, self._used - 2 * n_outputs

    @property
    def _offset(self) -> float:
        """Place of the start of the path among the points held."""
        return _MARGIN - 2.0 * self._done

    def _spread_image(
        self, block: _Block, sign: int, shift: float, low: float, high: float
    ) -> None:
        """Spread the mirror image ``sign * travel + shift`` of samples between two angles."""
        scale, offset = sign / self._step, shift / self._step + self._offset
        limits = 0.0, float(self._end - 2 * self._done)
        near = block.cut(*_near(block, scale, offset, limits, monotonic=self._monotonic))
        if not len(near.travel):
            return
        top = max(sign * low, sign * high) / self._step + offset
        self._reach(int(min(top + _WIDTH, limits[1])) + 1)
        place, grid = (scale, offset, _kernel_halves()), (self._grid, self._used)
        self._loops.spread(near.travel, near.ends, *place, near.values, self._means, *grid)

    def _reach(self, n_points: int) -> None:
        """Hold at least so many points."""
        if n_points > self._grid.shape[1]:
            longer = np.zeros((len(self._grid), n_points + n_points // 4))
            longer[:, : self._used] = self._grid[:, : self._used]
            self._grid = longer
        self._used = max(self._used, n_points)


def _near(
    block: _Block, scale: float, offset: float, limits: tuple[float, float], *, monotonic: bool
) -> tuple[int, int]:
    """Return first and last + 1 of the samples whose images lie between two places on the grid."""
    low, high = sorted((limit - offset) / scale for limit in limits)
    if monotonic:
        first, last = np.searchsorted(block.travel, (low, high))
    else:
        inside = np.flatnonzero((block.travel > low) & (block.travel < high))
        first, last = (inside[0], inside[-1] + 1) if len(inside) else (0, 0)
    return int(first), int(last)


def _kernel(distance: NDArray[np.floating]) -> NDArray[np.floating]:
    """Exponential of semicircle (Barnett et al., Eq. (1.8)), of distances in grid points."""
    z = distance * (2 / _WIDTH)
    return np.exp(_SHAPE * (np.sqrt(np.maximum(0.0, 1.0 - z * z)) - 1.0))


@lru_cache(maxsize=1)
def _kernel_halves() -> NDArray[np.floating]:
    """Polynomials for the kernel at the grid points below a sample, outermost first.

    Each is in the sample's place within its cell, -1/2..1/2, and stands for the kernel from here
    on: the decimating filter evens out the polynomials, not what they were fitted to. They agree
    with it at the ends of the cell, so that there is no step where a sample changes its cell.
    """
    place = np.cos(np.pi * np.arange(_DEGREE + 1) / _DEGREE) / 2
    halves = []
    for k in reversed(range(_WIDTH // 2)):
        values = _kernel(place + 0.5 + k)
        values[place + 0.5 + k == _WIDTH / 2] = 0.0  # where the kernel ends
        halves.append(Polynomial.fit(place, values, _DEGREE, domain=[-1, 1], window=[-1, 1]).coef)
    return np.array(halves)


def _kernel_spectrum(frequency: NDArray[np.floating]) -> NDArray[np.floating]:
    """Fourier transform of the kernel at frequencies in cycles per grid point."""
    node, weight = np.polynomial.legendre.leggauss(40)
    spectrum = np.zeros(len(frequency))
    for k, half in zip(reversed(range(_WIDTH // 2)), _kernel_halves(), strict=True):
        distance, value = node / 2 + 0.5 + k, Polynomial(half)(node / 2)
        # The kernel is even: a point above the sample counts as one below.
        spectrum += np.cos(2 * np.pi * np.outer(frequency, distance)) @ (weight * value)
    return spectrum


@lru_cache(maxsize=1)
def _decimating_filter() -> NDArray[np.floating]:
    """Low pass for keeping every other point of the fine grid, which also evens out the kernel."""
    # Frequencies in units of the fine grid's Nyquist frequency; that of the result is 0.5.
    passed = np.repeat(np.linspace(0, 0.5 * (PASS + 0.02), 41), 2)[1:-1]
    stopped = 0.5 * (2 - PASS - 0.02)
    bands = [*passed, stopped, 1.0]
    gains = [*(1 / _kernel_spectrum(passed / 2)), 0.0, 0.0]
    importance = [1.0] * (len(passed) // 2) + [10.0]
    return scipy.signal.firls(2 * _HALF + 1, bands, gains, weight=importance)


@lru_cache(maxsize=32)
def _upsampling_filter(factor: int) -> NDArray[np.floating]:
    """Low pass at the old Nyquist frequency; Kaiser's window for 80 dB."""
    taps, window = 2 * _UPSAMPLING_HALF * factor + 1, ("kaiser", scipy.signal.kaiser_beta(80))
    return factor * scipy.signal.firwin(taps, 1 / factor, window=window)
