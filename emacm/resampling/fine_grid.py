"""The fine grid that time samples are spread over, and the filter that keeps every other point.

Both are applied to a stroke part by part, in parts of a fixed number of samples counted from its
start, and with sums that do not depend on what follows. The result is therefore the same bit for
bit whether a stroke is read at once or while it is measured.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import scipy  # which imports scipy.signal, a tenth of a second, when it is used
from numpy.polynomial import Polynomial
from numpy.typing import NDArray


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
    shape : float
        Of the kernel exp(shape width (sqrt(1 - z²) - 1)): the least folding at this grid.
    degree : int
        Of the polynomials that stand for the kernel: within 1e-4 of it.
    half : int
        Half the decimating filter, in points of the fine grid.
    least_reversal : float
        Angle by which a shaft may always turn back along a stroke [rad].
    upsampling_half : int
        Time samples on either side that a new sample is made from.
    upsampling_stop : float
        Frequency at which the filter of the upsampling has fallen by 80 dB, over the sampling rate.
    part, mean_of, fewest : int
        Time samples, or samples of the shaft, that are spread at a time, and of which the mean is
        taken at the start of a stroke; the fewest for signals slower than the shaft.
    densest : int
        Dense samples for each sample of the signal, of the shaft and of the result, beyond which
        the shaft has jumped.
    """

    flat: float = 0.78
    width: int = 4
    shape: float = 2.4
    degree: int = 5
    half: int = 20
    least_reversal: float = 0.25
    upsampling_half: int = 16
    upsampling_stop: float = 0.58
    part: int = 1 << 13
    mean_of: int = 5000
    fewest: int = 16
    densest: int = 64

    @property
    def first(self) -> int:
        """Point that the filter of the first output reads first."""
        return self.width // 2

    @property
    def margin(self) -> int:
        """Fine grid points that are needed beyond either end of the stroke."""
        return self.half + self.first


DESIGN = GridDesign()


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


class FineGrid:
    """The fine grid of one stroke, of which only the part in work is held.

    Point `DESIGN.margin` + 2 j is the angle of output j.

    Parameters
    ----------
    loops : module
        The inner loops.
    means : ndarray of shape (n_rows,)
        Subtracted from the rows and added to the outputs, so that a large offset comes out exact
        whatever the ripple of the filter.
    theta_s : float
        Angle between outputs [rad].
    part : int
        Samples that are spread before the complete points are decimated.
    max_reversal : float
        Largest angle by which the shaft turns back on its way [rad].
    """

    def __init__(
        self,
        loops: ModuleType,
        means: NDArray[np.floating],
        theta_s: float,
        part: int,
        max_reversal: float = 0.0,
    ) -> None:
        self._loops = loops
        self.means = means
        self._step = theta_s / 2
        self.part = part
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
        self._tail = Block(np.zeros(2), [np.empty(0)] * len(means))

    @property
    def n_held(self) -> int:
        """Samples that are held for the mirror image at the end of the stroke."""
        return len(self._tail.travel)

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
        parts = np.maximum.reduceat(block.travel, np.arange(0, n_times, self.part))
        farthest = np.maximum(np.maximum.accumulate(parts), self._reached)
        outputs = np.empty((len(block.values), max(0, self._n_complete(farthest[-1]))))
        while start < n_times:
            stop = n_times
            if not self._done:  # one part at a time, each after its mirror image at the start
                stop = min(start + self.part, n_times)
                self._spread(block.cut(start, stop), -1)
            reached = farthest[start // self.part : -(-stop // self.part)]
            self._resample(block.cut(start, stop), reached, outputs, self._done - begun)
            start = stop
        self._tail = self._tail_with(block)
        return outputs

    def finish(self, length: float, n_angles: int) -> NDArray[np.floating]:
        """Return the last outputs of a stroke.

        Parameters
        ----------
        length : float
            Its length [rad].
        n_angles : int
            Number of all its outputs.

        Returns
        -------
        ndarray of shape (n_rows, n_outputs)
        """
        limit = 2 * (n_angles - 1) + 1 + 2 * DESIGN.margin - 2 * self._done  # of the points needed
        for sign, shift in _mirror_images(length, DESIGN.margin * self._step):
            self._spread(self._tail, sign, shift, limit)
        outputs = np.empty((len(self.means), n_angles - self._done))
        if outputs.shape[1]:
            self._use(DESIGN.first + 2 * (outputs.shape[1] - 1) + 1 + 2 * DESIGN.half)
            held, taps = (self._grid, self._used, DESIGN.first), _decimating_filter()
            self._loops.decimate(*held, taps, self.means, outputs, 0, outputs.shape[1])
        return outputs

    def state(self) -> dict[str, Any]:
        """Return what `restore` needs."""
        tail = self._tail
        return {
            "done": self._done,
            "grid": self._grid[:, : self._used].copy(),
            "reached": self._reached,
            "near": tail.near,
            "values": np.stack(tail.values),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state."""
        self._done, self._reached = int(state["done"]), float(state["reached"])
        self._grid = np.array(state["grid"])
        self._used = self._grid.shape[1]
        self._tail = Block(state["near"], list(state["values"]))

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
        self._reach(int(n_points.max()))
        place = 1 / self._step, self._offset, _kernel_halves()
        rows = block.values, self.means, self._grid
        steps = self.part, n_points, complete - before
        made = DESIGN.first, _decimating_filter(), outputs, done
        self._loops.resample(block.near, *place, *rows, *steps, *made)
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
        place = sign / self._step, offset, _kernel_halves()
        rows = block.values, self.means, self._grid
        one_part = len(block.travel), np.array([self._used]), np.zeros(1, int)
        made = DESIGN.first, _decimating_filter(), self._grid[:, :0], 0
        self._loops.resample(block.near, *place, *rows, *one_part, *made)

    def _use(self, n_points: int) -> None:
        """Have at least so many points in use."""
        self._reach(n_points)
        self._used = max(self._used, n_points)

    def _reach(self, n_points: int) -> None:
        """Hold at least so many points."""
        if n_points > self._grid.shape[1]:
            longer = np.zeros((len(self._grid), n_points + n_points // 4))
            longer[:, : self._used] = self._grid[:, : self._used]
            self._grid = longer

    def _tail_with(self, block: Block) -> Block:
        """Return the samples that a mirror image at the end may contain, some more added."""
        least = self._reached - 2 * self._reversal - (DESIGN.margin + 1) * self._step
        held = block.cut(_first_after(block.travel, least), len(block.travel))
        if len(held.travel) == len(block.travel):
            before = self._tail.cut(_first_after(self._tail.travel, least), self.n_held)
            near = np.concatenate([before.near[:-1], block.near[1:]])
            pairs = zip(before.values, block.values, strict=True)
            held = Block(near, [np.concatenate(pair) for pair in pairs])
        near, values = held
        steps = np.diff(near) != 0
        # While the shaft stands, samples have no weight: only the first and the last count.
        counts = slice(None) if steps.all() else steps[1:] | steps[:-1]
        near = np.concatenate([near[:1], near[1:-1][counts], near[-1:]])
        return Block(near, [row[counts].copy() for row in values])


def _first_after(travel: NDArray[np.floating], angle: float) -> int:
    """Return the sample after the last one up to an angle."""
    passed = np.flatnonzero(travel <= angle)
    return int(passed[-1]) + 1 if len(passed) else 0


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
    return np.exp(DESIGN.shape * DESIGN.width * (np.sqrt(np.maximum(0.0, 1.0 - z * z)) - 1.0))


@lru_cache(maxsize=1)
def _kernel_halves() -> NDArray[np.floating]:
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
        halves.append(
            Polynomial.fit(place, values, DESIGN.degree, domain=[-1, 1], window=[-1, 1]).coef
        )
    return np.array(halves)


def _kernel_spectrum(frequency: NDArray[np.floating]) -> NDArray[np.floating]:
    """Fourier transform of the kernel at frequencies in cycles per grid point."""
    node, weight = np.polynomial.legendre.leggauss(40)
    spectrum = np.zeros(len(frequency))
    for k, half in zip(reversed(range(DESIGN.width // 2)), _kernel_halves(), strict=True):
        distance, value = node / 2 + 0.5 + k, Polynomial(half)(node / 2)
        # The kernel is even: a point above the sample counts as one below.
        spectrum += np.cos(2 * np.pi * np.outer(frequency, distance)) @ (weight * value)
    return spectrum


@lru_cache(maxsize=1)
def _decimating_filter() -> NDArray[np.floating]:
    """Low pass for keeping every other point of the fine grid, which also evens out the kernel."""
    # Frequencies in units of the fine grid's Nyquist frequency; that of the result is 0.5.
    passed = np.repeat(np.linspace(0, 0.5 * (DESIGN.flat + 0.02), 41), 2)[1:-1]
    stopped = 0.5 * (2 - DESIGN.flat - 0.02)
    bands = [*passed, stopped, 1.0]
    gains = [*(1 / _kernel_spectrum(passed / 2)), 0.0, 0.0]
    importance = [1.0] * (len(passed) // 2) + [10.0]
    return scipy.signal.firls(2 * DESIGN.half + 1, bands, gains, weight=importance)
