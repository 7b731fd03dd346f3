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

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from sys import maxsize
from types import ModuleType
from typing import Any

import numpy as np
import scipy  # which imports scipy.signal, a tenth of a second, when it is used
from numpy.typing import NDArray

from emacm import _kernels
from emacm.resampling.fine_grid import DESIGN, Block, FineGrid
from emacm.shaft.motion import Series
from emacm.shaft.paths import ShaftPath


def spread_rows(
    rows: Sequence[Series], fs: float, path: ShaftPath, theta_s: float
) -> Iterator[NDArray[np.floating]]:
    """Resample rows to the grid angles, limited to the orders that the grid can represent.

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

    Returns
    -------
    iterator of ndarray of shape (n_rows, n_angles)
        The next angles; all blocks together cover the whole path.
    """
    path.count(theta_s)  # before a grid is made that is too large
    factor = upsampling(fs, path.fastest, theta_s)
    if factor > 1:
        _check_density(factor, fs, path, theta_s)
    return Spreading(fs, factor, theta_s, path.max_reversal).outputs(rows, path)


class Spreading:
    """Band-limited resampling of one stroke, as far as it is known.

    Parameters
    ----------
    fs : float
        Sampling rate of the signals [Hz].
    factor : int
        How much denser the time samples are made, as `upsampling` returns it for the whole stroke.
    theta_s : float
        Angle between samples of the result [rad].
    max_reversal : float
        Largest angle by which the shaft turns back along the stroke [rad]; up to
        `GridDesign.least_reversal`, the result does not depend on it.
    """

    def __init__(self, fs: float, factor: int, theta_s: float, max_reversal: float = 0.0) -> None:
        self._fs = fs
        self._factor = factor
        self._theta_s = theta_s
        self._max_reversal = max_reversal
        self._loops = _kernels.loops
        self._first = self._next = -1  # dense samples, counted from the start of the rows
        self._grid: FineGrid | None = None

    def outputs(
        self, rows: Sequence[Series], path: ShaftPath, *, complete: bool = True
    ) -> Iterator[NDArray[np.floating]]:
        """Yield the next samples at the grid angles.

        Parameters
        ----------
        rows : sequence of ndarray of shape (n_times,), or of objects that can be sliced like one
            Signals at times ``n / fs``, at least up to now.
        path : ShaftPath
            Travel of the shaft, at least up to now.
        complete : bool
            Whether rows and path are known as far as they matter for this stroke. Otherwise as
            much is resampled as does not depend on what follows, in whole parts.

        Yields
        ------
        ndarray of shape (n_rows, n_angles)
        """
        first, last = self._dense_range(rows, path)
        first = first if self._grid is None else self._first
        part = _limited(DESIGN.part, self._fs * self._factor, path)
        if not complete:
            known = self._known(rows, path)
            last = first + max(0, known - first) // part * part
        if self._grid is None:
            n_mean = _limited(DESIGN.mean_of, self._fs, path)
            begin, end = path.sample_range(self._fs, len(rows[0]))
            if not complete and (last == first or end - begin < n_mean):
                return
            # Later samples do not count, so that nothing has to wait for them.
            start = slice(begin, min(end, begin + n_mean))
            means = np.array([row[start].mean(dtype=np.float64) for row in rows])
            self._grid = FineGrid(self._loops, means, self._theta_s, part, self._max_reversal)
            self._first = self._next = first
        n_angles = path.count(self._theta_s)
        if complete and path.length < self._theta_s / 2:  # too short to hold more than its mean
            yield np.repeat(self._grid.means, n_angles).reshape(-1, n_angles)
            return
        # Less at once where the angle grid is dense, so that it takes no more memory than the
        # signals.
        density = 2 * path.fastest / (self._fs * self._factor * self._theta_s)
        at_once = max(1, int(self._loops.BLOCKS.spread / max(1.0, 2 * density)) // part) * part
        while self._next < last:
            stop = min(self._next + at_once, last)
            resampled = [self._grid.add(self._dense_block(rows, path, stop, last, complete))]
            self._next = stop
            if resampled[0].shape[1]:
                yield resampled.pop()  # what is not needed any more is gone before the next is made
        if complete:
            remaining = self._grid.finish(path.length, n_angles)
            if remaining.shape[1]:
                yield remaining

    def rows_needed(self, path: ShaftPath) -> int:
        """Return how many samples of the rows a complete path needs, if there are as many."""
        first, last = path.sample_range(self._fs * self._factor, maxsize)
        needed = max(last, first + 2)
        if self._factor == 1:
            return needed
        return -(-needed // self._factor) + DESIGN.upsampling_half + 1

    def needed_from(self, start_time: float) -> float:
        """Return the time of the first sample that is still needed [s].

        Parameters
        ----------
        start_time : float
            Start of the path [s].
        """
        if self._grid is None:
            return start_time
        return max(self._next - 1, 0) / (self._fs * self._factor)

    @property
    def n_held(self) -> int:
        """Samples that are held for the mirror image at the end of the stroke."""
        return 0 if self._grid is None else self._grid.n_held

    def state(self) -> dict[str, Any]:
        """Return what `restore` needs."""
        if self._grid is None:
            return {}
        places = {"first": self._first, "next": self._next, "part": self._grid.part}
        return {**places, "means": self._grid.means, "grid": self._grid.state()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state."""
        if not state:
            return
        self._first, self._next = int(state["first"]), int(state["next"])
        means, part = state["means"], int(state["part"])
        self._grid = FineGrid(self._loops, means, self._theta_s, part, self._max_reversal)
        self._grid.restore(state["grid"])

    def _dense_range(self, rows: Sequence[Series], path: ShaftPath) -> tuple[int, int]:
        """First and last + 1 of the dense samples on the path."""
        # At a higher rate, the signal continues, mirrored, to the end of the path.
        n_dense = self._factor * (len(rows[0]) + (self._factor > 1))
        return path.sample_range(self._fs * self._factor, n_dense)

    def _known(self, rows: Sequence[Series], path: ShaftPath) -> int:
        """Return the last + 1 dense sample that does not depend on what follows."""
        known = path.n_times - 5  # the cubic between samples depends on the four before them
        if known <= 0:
            return 0
        by_path = int(np.floor((path.start_time + known / path.fs) * self._fs * self._factor))
        if self._factor == 1:
            return min(by_path, len(rows[0]))
        return min(by_path, (len(rows[0]) - DESIGN.upsampling_half - 1) * self._factor)

    def _dense_block(
        self, rows: Sequence[Series], path: ShaftPath, stop: int, last: int, complete: bool
    ) -> Block:
        """Return the dense samples from the next one to `stop`."""
        rate, start = self._fs * self._factor, self._next
        low = max(start - 1, self._first)
        high = stop if complete and stop == last else stop + 1
        near = path.travel_at(rate, low, high)
        # Each sample stands for the way halfway to its neighbours, the outer ones up to the ends:
        # their neighbours beyond are their mirror images.
        before = [-near[:1]] if low == start else []
        after = [2 * path.length - near[-1:]] if high == stop else []
        if before or after:
            near = np.concatenate([*before, near, *after])
        if self._factor == 1:
            return Block(near, [row[start:stop] for row in rows])
        return Block(near, _upsampled(self._loops, rows, self._factor, start, stop))


def _limited(n_times: int, fs: float, path: ShaftPath) -> int:
    """Return a number of samples at a rate, or fewer, so that the shaft has about as many."""
    return max(DESIGN.fewest, int(n_times * min(1.0, fs / path.fs)))


def upsampling(fs: float, fastest: float, theta_s: float) -> int:
    """Return how much denser time samples must be for their sum to stand for the integral.

    Parameters
    ----------
    fs : float
        Their sampling rate [Hz].
    fastest : float
        Highest speed of the shaft [rad/s].
    theta_s : float
        Angle between samples of the result [rad].

    Returns
    -------
    int
    """
    # Highest frequency [Hz] that the kernel still lets through: what folds onto the pass band.
    reach = (4 - DESIGN.flat) * fastest / (2 * theta_s)
    return 1 if reach <= fs / 2 else int(max(2.0, np.ceil(reach / fs + DESIGN.upsampling_stop)))


def _check_density(factor: int, fs: float, path: ShaftPath, theta_s: float) -> None:
    """Raise a ValueError where the samples would have to be made too dense."""
    n_shaft = len(path.travel)
    n_dense = factor * fs * n_shaft / path.fs
    if n_dense > DESIGN.densest * (n_shaft + n_shaft * fs / path.fs + path.count(theta_s)):
        largest, place = path.largest_step()
        mean = path.length / (n_shaft - 1)
        raise ValueError(
            f"the shaft turns by {largest:.3g} rad within one of its samples, at "
            f"{path.start_time + place / path.fs:.6g} s; that is {largest / mean:.3g} "
            f"times its mean step. Is the angle in rad, and is this a jump? Repair or cut it."
        )


def _upsampled(
    loops: ModuleType, rows: Sequence[Series], factor: int, start: int, stop: int
) -> list[NDArray[np.floating]]:
    """Return samples `start` to `stop` of the rows at `factor` times their rate."""
    low = start // factor - DESIGN.upsampling_half
    high = -(-stop // factor) + DESIGN.upsampling_half + 1
    last = len(rows[0]) - 1
    first, count = start - low * factor, stop - start
    taps = _upsampling_filter(factor)
    if low >= 0 and high <= last + 1:
        parts = [row[low:high] for row in rows]
    else:  # mirrored at the ends of the recording
        index = np.abs((np.arange(low, high) + last) % (2 * last) - last)
        parts = [row[index] for row in rows]
    return [loops.upsample(part, taps, factor, first, count) for part in parts]


@lru_cache(maxsize=32)
def _upsampling_filter(factor: int) -> NDArray[np.floating]:
    """Low pass at the old Nyquist frequency; Kaiser's window for 80 dB."""
    taps, window = 2 * DESIGN.upsampling_half * factor + 1, ("kaiser", scipy.signal.kaiser_beta(80))
    return factor * scipy.signal.firwin(taps, 1 / factor, window=window)
