"""Refinement of a shaft speed by the phases of the lines of the shaft.

Where a shaft reverses, its lines vanish for a moment, and each of them has another phase
afterwards: that of order k changes by -2 (k a + p), where a is the angle at which the shaft
reverses and p the phase of this line at angle 0. The phases p are independent, so no change of the
speed explains the new phases. Such seconds are not steady.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage
from scipy.interpolate import PchipInterpolator

from emacm.shaft.speed_evidence import Whitened

Array = NDArray[np.floating]


class Course(NamedTuple):
    """Speeds in frames of a signal, and their reliability.

    Attributes
    ----------
    white : Whitened
        The signal.
    times, speeds, rates : ndarray of shape (n_frames,)
        Centres of the frames [s], speeds [Hz], and relative rates of change [1/s].
    trusted : ndarray of bool, shape (n_frames,)
        Which frames can be trusted.
    duration : float
        Of the frames [s].
    reliable : ndarray of bool, shape (n_seconds,)
        Seconds of which all frames can be trusted.
    refusal : str
        Message if there is none.
    """

    white: Whitened
    times: Array
    speeds: Array
    rates: Array
    trusted: NDArray[np.bool_]
    duration: float
    reliable: NDArray[np.bool_]
    refusal: str


def refined_speed(course: Course, orders: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Refine a speed by the phases of the orders, demodulated with the angle found so far.

    Parameters
    ----------
    course : Course
        Speeds in frames.
    orders : ndarray of shape (n_orders,)
        Orders that may have lines; the clear ones are used.

    Returns
    -------
    speed : ndarray of shape (n_times,)
        Speed at each sample of the whitened signal [Hz].
    steady : ndarray of bool, shape (n_seconds,)
        Seconds in which the lines keep their level and phase once demodulated, as they do only if
        the speed is right and the shaft neither reverses nor rests.
    """
    white = course.white
    n_times = len(white.signal)
    times = np.arange(n_times) / white.fs
    speed = _interpolated_speeds(times, course)
    spectrum = fft.fft(white.signal)
    spectrum[(n_times + 1) // 2 :] = 0  # positive frequencies only
    analytic: NDArray[np.complex128] = fft.ifft(spectrum)
    window = course.duration / (4 if course.duration >= 1 else 2)
    hop = max(1, int(window * white.fs / 2))
    for _ in range(3):
        turns = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2)]) / white.fs
        centres, change, _ = _phase_speeds(analytic, turns, orders, hop, white.fs)
        trusted = np.interp(centres, course.times, course.trusted.astype(float)) > 0
        speed = speed + np.interp(times, centres, np.where(trusted, change, 0.0))
    turns = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2)]) / white.fs
    *_, (agreed, shift) = _phase_speeds(analytic, turns, orders, hop, white.fs)
    shifted = analytic * np.exp(-2j * np.pi * shift * times)
    lines = (shifted * np.exp(-2j * np.pi * order * turns) for order in agreed)
    gap = float(np.diff(orders, prepend=0.0).min())
    return speed, steady_seconds(lines, turns, gap, course.reliable, white.fs)


def _interpolated_speeds(times: Array, course: Course) -> Array:
    """Interpolate the trusted speeds; a single frame goes on at its rate of change."""
    at, speeds = course.times[course.trusted], course.speeds[course.trusted]
    inner = np.clip(times, at[0], at[-1])
    interpolated: Array = PchipInterpolator(at, speeds)(inner) if len(at) > 1 else speeds
    ends = course.rates[course.trusted][[0, -1]] * speeds[[0, -1]]
    beyond = np.clip(times - inner, -course.duration / 2, course.duration / 2)
    return interpolated + np.where(beyond < 0, ends[0], ends[1]) * beyond


def _phase_speeds(
    analytic: NDArray[np.complex128], turns: Array, orders: Array, hop: int, fs: float
) -> tuple[Array, Array, tuple[Array, float]]:
    """Return times [s], corrections of the speed [Hz] from the phases of clear orders, and these.

    The orders are those that agree on one speed, with their common distance from the lines [Hz].
    """
    n_blocks = max(3, len(turns) // hop)
    starts = np.linspace(0, len(turns), n_blocks + 1).astype(np.intp)[:-1]
    length = np.diff(np.append(starts, len(turns)))

    def joined(wave: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Average over two blocks together, half overlapping."""
        blocks = np.add.reduceat(wave, starts) / length
        return np.asarray((blocks[1:] + blocks[:-1]) / 2, np.complex128)

    aside = np.exp(-2j * np.pi * 0.41 * turns)  # where no order is
    centre = (starts[1:] + 0.0) / fs
    middle, apart = (centre[1:] + centre[:-1]) / 2, np.diff(centre)
    clear, steps, weights = [], [], []
    for order in orders:
        wave = analytic * np.exp(-2j * np.pi * order * turns)
        line = joined(wave)
        between = np.mean(np.abs(joined(wave * aside)) ** 2) + 1e-300
        power = np.mean(np.abs(line) ** 2)
        if power < 4 * between:  # the phase of a weaker line is that of noise
            continue
        step = line[1:] * np.conj(line[:-1])
        clear.append(order)
        steps.append(step / power)
        # Beyond ten times this limit, a line says no more than others: it may not be the order's.
        weights.append(np.minimum(np.abs(step) / between, 40))
    if not clear:
        return middle, np.zeros(len(middle)), (np.zeros(0), 0.0)
    lines, clear_orders = np.array(steps), np.array(clear)
    moved = np.angle(lines.sum(axis=1)) / (2 * np.pi * apart.mean())
    duration = len(turns) / fs
    agreed, shift = _lines_of_shaft(clear_orders, moved, turns[-1] / duration, duration)
    changes = (np.angle(lines) / (2 * np.pi * apart) - shift) / clear_orders[:, np.newaxis]
    weight = np.array(weights) * (agreed * clear_orders**2)[:, np.newaxis]
    change = (weight * changes).sum(axis=0) / np.maximum(weight.sum(axis=0), 1e-300)
    smooth = ndimage.uniform_filter1d(change, min(3, len(change)), mode="nearest")
    return middle, smooth, (clear_orders[agreed], shift)


def _lines_of_shaft(
    orders: Array, moved: Array, speed: float, duration: float
) -> tuple[NDArray[np.bool_], float]:
    """Return which lines belong to the shaft, and their common distance from its orders [Hz].

    They are the most that the same correction of the speed explains. Sidebands of a bearing
    frequency lie at the same distance from several orders; their spacing is the speed. As any two
    lines have a spacing, sidebands must be more by two lines than others.
    """
    tolerance = 0.1 / duration + 5e-5 * orders * speed
    # Two lines must be three orders apart for their spacing to give the speed.
    first, second = np.nonzero(np.subtract.outer(orders, orders) <= -3)
    spacing = (moved[second] - moved[first]) / (orders[second] - orders[first])
    changes = np.concatenate([moved / orders, spacing])
    shifts = np.concatenate([np.zeros(len(orders)), moved[first] - orders[first] * spacing])
    left = moved - np.outer(changes, orders) - shifts[:, np.newaxis]
    agreed = np.abs(left) <= tolerance
    votes = np.sum(agreed * (1 - (left / tolerance) ** 2), axis=1)  # a near line counts more
    votes[len(orders) :] -= 2
    votes[np.abs(changes) > 5e-3 * speed] = 0  # that is another speed
    best = int(np.argmax(votes))  # the lowest order of equals
    of_shaft = np.asarray(agreed[best])
    sidebands = best >= len(orders)
    shift = np.polyfit(orders[of_shaft], moved[of_shaft], 1)[1] if sidebands else 0.0
    return of_shaft, float(shift)


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
    for shortest in (0.1, 0.2, 0.4, 0.8):  # seconds, rounded up to whole periods
        length = np.ceil(shortest * speed * gap) / gap
        n_halves = int((turns[-1] - turns[0]) / (length / 2))
        starts = turns[0] + np.arange(n_halves - 1) * (length / 2)
        starts = np.append(starts, turns[-1] - length)  # a last block that ends with the signal
        first = np.searchsorted(turns, starts)
        last = np.maximum(np.searchsorted(turns, starts + length), first + 1)
        blocks = np.array([(total[last] - total[first]) / (last - first) for total in sums])
        levels = np.mean(np.abs(blocks) ** 2, axis=1)
        weights = np.minimum(levels, 4 * np.median(levels))  # no line decides alone
        weights /= max(weights.sum(), 1e-300)
        # Fewer than 2.5 lines of equal weight may keep their phases by chance: a reversal of a
        # tenth of a second would be hidden in longer blocks.
        few = weights @ weights > 1 / 2.5
        if n_halves < 4 or (few and length / speed > 0.21):
            continue
        # 0 to 2; independent phases change by 1.
        changes, usual = _largest_changes(blocks, weights, first / fs, last / fs, reliable)
        steady = changes < min(0.2 + 3 * usual, 0.6)
        if usual < 0.2:  # else noise alone may explain a change
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
