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

A stroke is processed part by part, in parts of a fixed number of samples counted from its start,
with sums that do not depend on what follows. The result is therefore the same bit for bit whether a
stroke is read at once or while it is measured.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from sys import maxsize
from typing import Any, NamedTuple

import numpy as np
import scipy  # which imports scipy.signal, a tenth of a second, when it is used
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from emacm import _kernels
from emacm._saved import Resumable
from emacm.shaft.motion import Series, ShaftPath, mirrored


@dataclass(frozen=True)
class GridDesign:
    """Design of the band-limited resampling.

    ``pytest tests/resampling/test_spreading.py`` measures that the pass band is flat within
    0.01 dB up to `flat`, and that what is aliased into it is down by more than 60 dB. The inner
    loops are written for the given `width`, `degree`, `half` and `upsampling_half`.

    Attributes
    ----------
    flat : float
        End of the pass band, as a fraction of the highest order pi/theta_s.
    width : int
        Grid points over which a time sample is spread.
    degree : int
        Of the polynomials that stand for the kernel: within 1e-4 of it.
    half : int
        Half the decimating filter, in points of the fine grid.
    least_reversal : float
        Angle by which a shaft may always turn back along a stroke [rad].
    upsampling_half : int
        Time samples on either side that a new sample is made from.
    part, mean_of : int
        Time samples, or samples of the shaft, that are spread at a time, and of which the mean is
        taken at the start of a stroke.
    first, margin : int
        Point that the filter of the first output reads first, half of `width`; fine grid points
        that are needed beyond either end of the stroke, `half` more.
    """

    flat: float = 0.78
    width: int = 4
    degree: int = 5
    half: int = 20
    least_reversal: float = 0.25
    upsampling_half: int = 16
    part: int = 1 << 13
    mean_of: int = 5000
    first: int = 2
    margin: int = 22


DESIGN = GridDesign()


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
    factor = upsampling(fs, path.fastest, theta_s)
    if factor > 1:
        _check_density(factor, fs, path, theta_s)
    return Spreading(fs, factor, theta_s, path.max_reversal).outputs(rows, path)


def upsampling(fs: float, fastest: float, theta_s: float) -> int:
    """Return how much denser time samples must be for their sum to stand for the integral.

    `fastest` is the highest speed of the shaft [rad/s].
    """
    # Highest frequency [Hz] that the kernel still lets through: what folds onto the pass band.
    reach = (4 - DESIGN.flat) * fastest / (2 * theta_s)
    # The filter of the upsampling has fallen by 80 dB at 0.58 of the sampling rate.
    return 1 if reach <= fs / 2 else int(max(2.0, np.ceil(reach / fs + 0.58)))


class Spreading(Resumable):
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

    held = ("_first", "_next", "_grid")

    def __init__(self, fs: float, factor: int, theta_s: float, max_reversal: float = 0.0) -> None:
        self._fs = fs
        self._factor = factor
        self._theta_s = theta_s
        self._max_reversal = max_reversal
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
            last = first + max(0, self._known(rows, path) - first) // part * part
        if self._grid is None:
            n_mean = _limited(DESIGN.mean_of, self._fs, path)
            begin, end = path.sample_range(self._fs, len(rows[0]))
            if not complete and (last == first or end - begin < n_mean):
                return
            # Later samples do not count, so that nothing has to wait for them.
            start = slice(begin, min(end, begin + n_mean))
            means = np.array([row[start].mean(dtype=np.float64) for row in rows])
            self._grid = FineGrid(means, self._theta_s, part, self._max_reversal)
            self._first = self._next = first
        grid, n_angles = self._grid, path.count(self._theta_s)
        if complete and path.length < self._theta_s / 2:  # too short to hold more than its mean
            yield np.repeat(grid.means, n_angles).reshape(-1, n_angles)
            return
        # Less at once where the angle grid is dense, so that it takes no more memory than the
        # signals.
        density = 4 * path.fastest / (self._fs * self._factor * self._theta_s)
        at_once = max(1, int(grid.loops.SPREAD_AT_ONCE / max(1.0, density)) // part) * part
        while self._next < last:
            stop = min(self._next + at_once, last)
            resampled = [grid.add(self._dense_block(rows, path, stop, complete and stop == last))]
            self._next = stop
            if resampled[0].shape[1]:
                yield resampled.pop()  # what is not needed any more is gone before the next is made
        if complete:
            remaining = grid.finish(path.length, n_angles)
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
        """Return the time of the first sample still needed, for a path from `start_time` [s]."""
        if self._grid is None:
            return start_time
        return max(self._next - 1, 0) / (self._fs * self._factor)

    @property
    def n_held(self) -> int:
        """Samples that are held for the mirror image at the end of the stroke."""
        return 0 if self._grid is None else len(self._grid.tail.travel)

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state."""
        if grid := state["_grid"]:
            self._grid = FineGrid(grid["means"], self._theta_s, grid["_part"], self._max_reversal)
        super().restore(state)

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
        self, rows: Sequence[Series], path: ShaftPath, stop: int, at_end: bool
    ) -> Block:
        """Return the dense samples from the next one to `stop`, which may be the last ones."""
        start = self._next
        low, high = max(start - 1, self._first), stop if at_end else stop + 1
        near = path.travel_at(self._fs * self._factor, low, high)
        # Each sample stands for the way halfway to its neighbours, the outer ones up to the ends:
        # their neighbours beyond are their mirror images.
        before = [-near[:1]] if low == start else []
        after = [2 * path.length - near[-1:]] if high == stop else []
        if before or after:
            near = np.concatenate([*before, near, *after])
        if self._factor == 1:
            return Block(near, [row[start:stop] for row in rows])
        return Block(near, _upsampled(rows, self._factor, start, stop))


class Block(NamedTuple):
    """Consecutive time samples, dense enough for their sum to stand for the integral.

    Attributes
    ----------
    near : ndarray of shape (n + 2,)
        Angle travelled, at the samples and at one more on either side [rad].
    values : list of ndarray of shape (n,)
        Of each row.
    """

    near: NDArray[np.floating]
    values: list[NDArray[np.floating]]

    @property
    def travel(self) -> NDArray[np.floating]:
        """Angle travelled at the samples [rad], shape (n,)."""
        return self.near[1:-1]

    def cut(self, first: int, last: int) -> Block:
        """Return the samples `first` to `last` (exclusive)."""
        return Block(self.near[first : last + 2], [row[first:last] for row in self.values])

    def since(self, angle: float) -> Block:
        """Return the samples after the last one up to an angle."""
        passed, n_times = self.travel[::-1] <= angle, len(self.travel)
        first = n_times - int(passed.argmax()) if passed.any() else 0
        return self.cut(first, n_times)


class FineGrid(Resumable):
    """The fine grid of one stroke, of which only the part in work is held.

    Point `DESIGN.margin` + 2 j is the angle of output j.

    Parameters
    ----------
    means : ndarray of shape (n_rows,)
        Subtracted from the rows and added to the outputs, so that a large offset comes out exact
        whatever the ripple of the filter.
    theta_s : float
        Angle between outputs [rad].
    part : int
        Samples that are spread before the complete points are decimated.
    max_reversal : float
        Largest angle by which the shaft turns back on its way [rad].

    Attributes
    ----------
    loops : module
        The inner loops.
    tail : Block
        Samples that a mirror image at the end of the stroke may contain.
    """

    held = ("means", "tail", "_part", "_done", "_grid", "_used", "_reached")

    def __init__(
        self, means: NDArray[np.floating], theta_s: float, part: int, max_reversal: float
    ) -> None:
        self.loops = _kernels.loops
        self.means = means
        self._step = theta_s / 2
        self._part = part
        self._reversal = max(max_reversal, DESIGN.least_reversal)
        # So far behind the farthest sample an output may stand: what the shaft may still turn back,
        # and as much again, as a shaft that went beyond its end is mirrored back from there; the
        # filter; as much as mirror images reach over the ends; and a point, for rounding.
        self._lag = (
            2 * self._reversal / self._step + DESIGN.margin + 2 * DESIGN.half + DESIGN.first + 1
        )
        self._done = 0  # outputs
        self._used = 0  # points held, from point 2 * self._done upwards
        self._grid = np.zeros((len(means), 0))
        self._reached = 0.0  # farthest angle travelled so far
        self.tail = Block(np.zeros(2), [np.empty(0)] * len(means))

    def add(self, block: Block) -> NDArray[np.floating]:
        """Spread the next samples, and return the outputs that are complete.

        Parameters
        ----------
        block : Block
            A whole number of parts, except for the last samples of the stroke.

        Returns
        -------
        ndarray of shape (n_rows, n_outputs)
            May be empty.
        """
        n_times, begun, start = len(block.travel), self._done, 0
        parts = np.maximum.reduceat(block.travel, np.arange(0, n_times, self._part))
        farthest = np.maximum(np.maximum.accumulate(parts), self._reached)
        outputs = np.empty((len(block.values), max(0, self._n_complete(farthest[-1]))))
        while start < n_times:
            stop = n_times
            if not self._done:  # one part at a time, each after its mirror image at the start
                stop = min(start + self._part, n_times)
                self._spread(block.cut(start, stop), -1)
            reached = farthest[start // self._part : -(-stop // self._part)]
            self._resample(block.cut(start, stop), reached, outputs, self._done - begun)
            start = stop
        self.tail = self._tail_with(block)
        return outputs

    def finish(self, length: float, n_angles: int) -> NDArray[np.floating]:
        """Return the last of all `n_angles` outputs of a stroke of this length [rad]."""
        limit = 2 * (n_angles - 1) + 1 + 2 * DESIGN.margin - 2 * self._done  # of the points needed
        for sign, shift in _mirror_images(length, DESIGN.margin * self._step):
            self._spread(self.tail, sign, shift, limit)
        outputs = np.empty((len(self.means), n_angles - self._done))
        if outputs.shape[1]:
            self._use(DESIGN.first + 2 * (outputs.shape[1] - 1) + 1 + 2 * DESIGN.half)
            filtered = (DESIGN.first, decimating_filter()), self.means, (outputs, 0)
            self.loops.decimate(self._grid, self._used, *filtered, outputs.shape[1])
        return outputs

    def _n_complete(self, reached: Any) -> Any:
        """Count the outputs that no later sample changes."""
        # Rounded down before what is done is taken off, so that all calls count alike.
        return ((reached / self._step + DESIGN.margin - self._lag) // 2).astype(int) - self._done

    @property
    def _offset(self) -> float:
        """Place of the start of the path among the points held."""
        return DESIGN.margin - 2.0 * self._done

    def _resample(
        self, block: Block, reached: NDArray[np.floating], outputs: NDArray[np.floating], done: int
    ) -> None:
        """Spread samples, part by part, and fill the outputs that are complete after each.

        `reached` is the farthest angle up to the end of each part [rad]; `done` outputs are filled.
        """
        tops = (reached / self._step + self._offset).astype(int) + 1 + DESIGN.width // 2
        complete = np.maximum(self._n_complete(reached), 0)
        before = np.concatenate([[0], complete[:-1]])
        n_points = np.maximum(tops, self._used) - 2 * before
        self._use(int(n_points.max()))
        steps = self._part, n_points, complete - before
        self._run(block, (1 / self._step, self._offset), steps, (outputs, done))
        self._reached = float(reached[-1])
        self._done += int(complete[-1])
        self._used = int(n_points[-1] - 2 * (complete[-1] - before[-1]))

    def _spread(self, block: Block, sign: int, shift: float = 0.0, limit: float = np.inf) -> None:
        """Spread a mirror image, at the angles ``sign * travel + shift``, below point `limit`."""
        offset = shift / self._step + self._offset
        position = sign / self._step * block.travel + offset
        inside = np.flatnonzero((position > 0) & (position < limit))
        if not len(inside):
            return
        block = block.cut(int(inside[0]), int(inside[-1]) + 1)
        self._use(int(min(float(position.max()), limit)) + 1 + DESIGN.width // 2)
        one_part = len(block.travel), np.array([self._used]), np.zeros(1, int)
        self._run(block, (sign / self._step, offset), one_part, (self._grid[:, :0], 0))

    def _run(self, block: Block, place: Any, parts: Any, made: Any) -> None:
        """Run the inner loop: scale and offset of angles; parts; outputs and those filled."""
        rows, lowpass = (block.values, self.means, self._grid), (DESIGN.first, decimating_filter())
        self.loops.resample(block.near, place, kernel_halves(), *rows, parts, lowpass, made)

    def _use(self, n_points: int) -> None:
        """Have at least so many points in use."""
        if n_points > self._grid.shape[1]:
            longer = np.zeros((len(self._grid), n_points + n_points // 4))
            longer[:, : self._used] = self._grid[:, : self._used]
            self._grid = longer
        self._used = max(self._used, n_points)

    def _tail_with(self, block: Block) -> Block:
        """Return the samples that a mirror image at the end may contain, some more added."""
        least = self._reached - 2 * self._reversal - (DESIGN.margin + 1) * self._step
        held = block.since(least)
        if len(held.travel) == len(block.travel):
            before = self.tail.since(least)
            near = np.concatenate([before.near[:-1], block.near[1:]])
            pairs = zip(before.values, block.values, strict=True)
            held = Block(near, [np.concatenate(pair) for pair in pairs])
        near, values = held
        steps = np.diff(near) != 0
        # While the shaft stands, samples have no weight: only the first and the last count.
        counts = slice(None) if steps.all() else steps[1:] | steps[:-1]
        near = np.concatenate([near[:1], near[1:-1][counts], near[-1:]])
        return Block(near, [row[counts].copy() for row in values])


def _limited(n_times: int, fs: float, path: ShaftPath) -> int:
    """Return a number of samples at a rate, or fewer, so that the shaft has about as many."""
    return max(16, int(n_times * min(1.0, fs / path.fs)))


def _check_density(factor: int, fs: float, path: ShaftPath, theta_s: float) -> None:
    """Raise a ValueError where the samples would have to be made too dense."""
    n_shaft = len(path.travel)
    n_dense = factor * fs * n_shaft / path.fs
    # Beyond 64 for each sample of the shaft, of the signal and of the result, the shaft jumped.
    if n_dense > 64 * (n_shaft + n_shaft * fs / path.fs + path.count(theta_s)):
        largest, place = path.largest_step()
        mean = path.length / (n_shaft - 1)
        raise ValueError(
            f"the shaft turns by {largest:.3g} rad within one of its samples, at "
            f"{path.start_time + place / path.fs:.6g} s; that is {largest / mean:.3g} "
            f"times its mean step. Is the angle in rad, and is this a jump? Repair or cut it."
        )


def _upsampled(
    rows: Sequence[Series], factor: int, start: int, stop: int
) -> list[NDArray[np.floating]]:
    """Return samples `start` to `stop` of the rows at `factor` times their rate."""
    low = start // factor - DESIGN.upsampling_half
    high = -(-stop // factor) + DESIGN.upsampling_half + 1
    wanted = upsampling_filter(factor), factor, start - low * factor, stop - start
    return [_kernels.loops.upsample(mirrored(row, low, high), *wanted) for row in rows]


@lru_cache(maxsize=32)
def upsampling_filter(factor: int) -> NDArray[np.floating]:
    """Low pass at the old Nyquist frequency; Kaiser's window for 80 dB."""
    taps, window = 2 * DESIGN.upsampling_half * factor + 1, ("kaiser", scipy.signal.kaiser_beta(80))
    return factor * scipy.signal.firwin(taps, 1 / factor, window=window)


def _mirror_images(length: float, margin: float) -> Iterator[tuple[int, float]]:
    """Yield sign and shift of the mirror images at the end that are near a path of this length.

    Mirroring at 0 and at `length`, over and over, leads to 2 k length - travel and, twice
    mirrored, to 2 k length + travel. The first one, -travel, does not depend on the length.
    """
    n_images = int(np.ceil(margin / length)) + 1
    for k in range(-n_images, n_images + 1):
        for sign in (-1, 1) if k else ():
            ends = sorted((2 * k * length, (2 * k + sign) * length))
            if ends[1] > -margin and ends[0] < length + margin:
                yield sign, 2 * k * length


def _kernel(distance: NDArray[np.floating]) -> NDArray[np.floating]:
    """Exponential of semicircle (Barnett et al., Eq. (1.8)), of distances in grid points."""
    z = distance * (2 / DESIGN.width)
    # A shape of 2.4 gives the least folding at this grid.
    return np.exp(2.4 * DESIGN.width * (np.sqrt(np.maximum(0.0, 1.0 - z * z)) - 1.0))


@lru_cache(maxsize=1)
def kernel_halves() -> NDArray[np.floating]:
    """Polynomials for the kernel at the grid points below a sample, outermost first.

    Each is in the sample's place within its cell, -1/2..1/2, and stands for the kernel from here
    on: the decimating filter evens out the polynomials, not what they were fitted to. They agree
    with it at the ends of the cell, so that there is no step where a sample changes its cell.
    """
    place = np.cos(np.pi * np.arange(DESIGN.degree + 1) / DESIGN.degree) / 2
    halves = []
    for k in reversed(range(DESIGN.width // 2)):
        values = _kernel(place + 0.5 + k)
        values[place + 0.5 + k == DESIGN.width / 2] = 0.0  # where the kernel ends
        halves.append(Polynomial.fit(place, values, DESIGN.degree, domain=[-1, 1]).coef)
    return np.array(halves)


def _kernel_spectrum(frequency: NDArray[np.floating]) -> NDArray[np.float64]:
    """Fourier transform of the kernel at frequencies in cycles per grid point."""
    node, weight = np.polynomial.legendre.leggauss(40)
    spectrum = np.zeros(len(frequency))
    for k, half in zip(reversed(range(DESIGN.width // 2)), kernel_halves(), strict=True):
        distance = node / 2 + 0.5 + k
        value = np.asarray(Polynomial(half)(node / 2), np.float64)
        # The kernel is even: a point above the sample counts as one below.
        spectrum += np.cos(2 * np.pi * np.outer(frequency, distance)) @ (weight * value)
    return spectrum


@lru_cache(maxsize=1)
def decimating_filter() -> NDArray[np.floating]:
    """Low pass for keeping every other point of the fine grid, which also evens out the kernel."""
    # Frequencies in units of the fine grid's Nyquist frequency; that of the result is 0.5.
    passed = np.repeat(np.linspace(0, 0.5 * (DESIGN.flat + 0.02), 41), 2)[1:-1]
    stopped = 0.5 * (2 - DESIGN.flat - 0.02)
    bands = [*passed, stopped, 1.0]
    gains = [*(1 / _kernel_spectrum(passed / 2)), 0.0, 0.0]
    importance = [1.0] * (len(passed) // 2) + [10.0]
    return scipy.signal.firls(2 * DESIGN.half + 1, bands, gains, weight=importance)
