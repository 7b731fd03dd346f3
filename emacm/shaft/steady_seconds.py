"""Seconds in which a shaft neither reverses nor rests, by the lines of the shaft.

Where a shaft reverses, its lines vanish for a moment, and each of them has another phase
afterwards: that of order k changes by -2 (k a + p), where a is the angle at which the shaft
reverses and p the phase of this line at angle 0. The phases p are independent, so no change of the
speed explains the new phases.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]

_BLOCKS = 0.1, 0.2, 0.4, 0.8  # s, at least; rounded up to whole periods of the orders
_SHORT = 0.21  # s; in longer blocks, a reversal of a tenth of a second may hide
_FEW = 2.5  # lines, of equal weight: by chance, so many do not keep their phases
_WEIGHT = 4.0  # largest weight of a line, in medians of all
# Change between two blocks, 0 to 2, where 1 is expected of independent phases: its median, from
# which noise alone may explain a change, and the largest change of a steady second, which is the
# first number, and the second one times the median, at most the third.
_NOISE, _CHANGE = 0.2, (0.2, 3.0, 0.6)


def steady_seconds(
    lines: Iterable[NDArray[np.complex128]],
    turns: Array,
    gap: float,
    reliable: NDArray[np.bool_],
    fs: float,
) -> NDArray[np.bool_]:
    """Tell in which seconds the lines of a shaft keep their level and phase.

    The shortest blocks decide in which the lines stand out from the noise. If they do in none, the
    longest ones decide. Blocks overlap by half, so that one of them lies within a short rest.

    Parameters
    ----------
    lines : iterable of ndarray of shape (n_times,)
        The signal moved down by each of the orders of some lines.
    turns : ndarray of shape (n_times,)
        Shaft angle, in revolutions, ascending.
    gap : float
        Distance of two orders. Blocks of whole periods of it separate the lines.
    reliable : ndarray of bool, shape (n_seconds,)
        Seconds that count.
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    ndarray of bool, shape (n_seconds,)

    Examples
    --------
    >>> import numpy as np
    >>> times = np.arange(4000) / 1000
    >>> line = np.where(times < 2.5, 1.0, 1j) * np.ones(4000)  # another phase after 2.5 s
    >>> steady_seconds([line], 20 * times, 1.0, np.ones(4, bool), 1000)
    array([ True,  True, False,  True])
    """
    sums = [np.concatenate([[0], np.cumsum(line)]) for line in lines]
    steady = np.zeros(len(reliable), bool)
    if not (sums and reliable.any()):
        return steady
    speed = (turns[-1] - turns[0]) / (len(turns) / fs)
    for shortest in _BLOCKS:
        length = np.ceil(shortest * speed * gap) / gap
        n_halves = int((turns[-1] - turns[0]) / (length / 2))
        starts = turns[0] + np.arange(n_halves - 1) * (length / 2)
        starts = np.append(starts, turns[-1] - length)  # a last block that ends with the signal
        first = np.searchsorted(turns, starts)
        last = np.maximum(np.searchsorted(turns, starts + length), first + 1)
        blocks = np.array([(total[last] - total[first]) / (last - first) for total in sums])
        levels = np.mean(np.abs(blocks) ** 2, axis=1)
        weights = np.minimum(levels, _WEIGHT * np.median(levels))
        weights /= max(weights.sum(), 1e-300)
        few = weights @ weights > 1 / _FEW
        if n_halves < 4 or (few and length / speed > _SHORT):
            continue
        changes, known = _largest_changes(blocks, weights, first / fs, last / fs, reliable)
        least, factor, most = _CHANGE
        steady = changes < min(least + factor * known, most)
        if known < _NOISE:
            break
    return steady


def _largest_changes(
    blocks: NDArray[np.complex128],
    weights: Array,
    starts: Array,
    stops: Array,
    reliable: NDArray[np.bool_],
) -> tuple[Array, float]:
    """Return the largest change between blocks in each second, and the median of all changes."""
    largest, usual = np.zeros(len(reliable)), []
    for lag in (2, 3, 4):  # half blocks
        one, other = blocks[:, :-lag], blocks[:, lag:]
        power = np.abs(one) ** 2 + np.abs(other) ** 2
        change = weights @ (np.abs(other - one) ** 2 / np.maximum(power, 1e-300))
        low, high = starts[:-lag], stops[lag:]
        for second in np.flatnonzero(reliable):
            inside = change[(high > second) & (low < second + 1)]
            largest[second] = max(largest[second], inside.max(initial=0))
            usual.append(inside)
    return largest, float(np.median(np.concatenate(usual)))
