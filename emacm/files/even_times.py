"""Whether the times of samples are even: rounding, gaps, shared times, jitter.

All types of files use this decision. A channel has one rate, so that times that are not even are
explained (by rounding), stated (small jitter), resampled on request, or refused with what was
found, where, and the remedy.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy  # scipy.interpolate is imported when it is used
from numpy.typing import NDArray

from emacm._statements import warn

Times = NDArray[np.float64]


class EvenTimes(NamedTuple):
    """The rate of a column [Hz], and its times [s] if it must be resampled to this rate."""

    rate: float
    uneven: Times | None = None

    def resampled(self, values: NDArray[np.floating], channel: str = "") -> NDArray[np.floating]:
        """Return values at even times, by a cubic spline where the times are uneven.

        Parameters
        ----------
        values : ndarray of shape (n_times,)
            Values at the times of the file.
        channel : str
            Name for the warning; "" for the motion of the shaft, which is interpolated linearly.

        Returns
        -------
        ndarray of shape (n_even_times,)

        Warns
        -----
        EmacmWarning
            States the error of every tenth sample if it is left out.
        """
        times = self.uneven
        if times is None:
            return values
        even = np.arange(int(times[-1] * self.rate + 1e-6) + 1) / self.rate
        if not channel:
            return np.interp(even, times, values)
        kept = np.arange(len(times)) % 10 != 1
        left_out = scipy.interpolate.CubicSpline(times[kept], values[kept])(times[~kept])
        error = np.sqrt(np.mean((left_out - values[~kept]) ** 2)) / (np.std(values) or 1.0)
        text = f"channel {channel!r} was resampled from uneven times to {self.rate:.9g} Hz; samples"
        text += f" left out were found within {error:.2g} of its standard deviation."
        warn("times", text, channel=channel)
        return scipy.interpolate.CubicSpline(times, values)(even)


def even_times(
    seconds: Times,
    name: str,
    fs: float | None = None,
    *,
    size: float = 1.0,
    resample: bool = False,
    most_jitter: float = 0.1,
) -> EvenTimes:
    """Return the sampling rate of times, if they are even.

    Parameters
    ----------
    seconds : ndarray of shape (n_times,)
        Times, from 0 [s].
    name : str
        Name of the column, for messages.
    fs : float, optional
        Rate [Hz] that they must have.
    size : float
        Size of the unit in which the file has them, as decimals that may be rounded [s].
    resample : bool
        Whether samples may be resampled, so that jitter and single missing samples are allowed.
    most_jitter : float
        Largest root mean square of jitter in sampling intervals. The error of a sine at a
        quarter of the rate is π/2 times as large, here 16 %.

    Returns
    -------
    EvenTimes
        With the rate `fs`, or the roundest rate that agrees with all times.

    Raises
    ------
    ValueError
        If times do not increase, have gaps (intervals near multiples of the usual one, however
        regular), are shared by several samples, jitter by more than `most_jitter`, contradict
        `fs`, or are rounded so much that they leave over 1 % of the rate open; the message names
        the sample.

    Warns
    -----
    EmacmWarning
        If rounding leaves more than 1e-5 of the rate open, or there is jitter above 0.5 % of a
        sampling interval; not if `fs` is given.

    Examples
    --------
    >>> even_times(np.round(np.arange(12_000) / 12_000, 6), "time").rate
    12000.0
    """
    steps = np.diff(seconds)
    tick = _tick(seconds / size, steps / size) * size if steps.any() else 1e-3
    is_rising = len(steps) > 0 and steps.min() >= 0
    if fs and is_rising:
        allowed = (0.1 if len(steps) > 100 else 0.5) / fs + tick  # few: jitter hides the rate
        if np.abs(seconds - np.arange(len(seconds)) / fs).max() <= allowed:
            return EvenTimes(fs)
    if not is_rising or not steps.any():
        place = int(np.argmax(steps < 0)) + 1 if len(steps) else 0
        raise ValueError(
            f"time column {name!r} does not increase at sample {place}, {seconds[place]:.6g} s. "
            f"Choose the column of times, sort or cut the recording, or {ignore_hint(name)}."
        )
    grid = _fitted(seconds, steps, tick, fs)
    long, equal = steps > 1.75 * grid.usual, steps <= 1e-6 * grid.usual
    long[:-1] &= steps[1:] > 0.5 * grid.usual  # a single late sample is jitter,
    long &= np.std(steps[~long]) < 0.2 * grid.usual  # and so are all if the others vary, too
    is_rounded = grid.spread <= 1.05 * tick and np.ptp(steps) < 1.5 * tick
    if is_rounded and tick > max(0.01 * seconds[-1], 1.5 / grid.rate):
        raise ValueError(
            f"time column {name!r} is rounded to {tick:g} s, which leaves the sampling rate "
            f"open: about {grid.rate:.3g} Hz. State fs, and time = false (in Python: False)."
        )
    # Rounding, too, makes some steps longer, or zero. It is told from missing samples and packets
    # by many such steps, at distances that differ; times in ms often have equally many samples.
    is_rounded &= not long.any() or not _are_few(long, long)
    is_rounded &= not equal.any() or not _are_few(equal, ~equal if tick > 1.5e-3 else equal[:0])
    is_filled = resample and not equal.any() and steps.max() < 3.5 * grid.usual
    if not is_rounded and is_filled and (long.any() or grid.jitter > 0.005):
        rate = float(f"{np.rint(steps / grid.usual).sum() / seconds[-1]:.4g}")
        if not fs or abs(fs / rate - 1) < 0.05:  # lower rates would need a filter
            return EvenTimes(fs or rate, seconds)
    is_even = is_rounded or not (long.any() or equal.any() or grid.jitter > most_jitter)
    if not is_even or not grid.agrees:
        raise ValueError(
            f"time column {name!r} is not evenly spaced{_found(seconds, long, equal, grid, fs)}; "
            f"or {ignore_hint(name)}."
        )
    open_part = tick / seconds[-1]
    if fs is None and is_rounded and grid.spread > 0.1 * tick and open_part > 1e-5:
        text = f"are rounded to {tick:.6g} s: the rate is {grid.rate:.9g} Hz within {open_part:.1g}"
        warn("times", f"times {name!r} {text} of it. State fs if it is known better.")
    elif fs is None and not is_rounded and grid.jitter > 0.005:
        text = f"jitter by {grid.jitter:.1%} of a sampling interval (rms), and are taken as even at"
        text += f" {grid.rate:.9g} Hz: an error of {np.pi * grid.jitter:.0%} near half this rate. "
        warn("times", f"times {name!r} {text}Set resample = true if they are those of the samples.")
    return EvenTimes(grid.rate)


def _are_few(odd: NDArray[np.bool_], regular: NDArray[np.bool_]) -> bool:
    """Tell whether there are less than 8 odd steps, or regular ones all at one distance."""
    distances = np.diff(np.flatnonzero(regular))
    return bool(odd.sum() < 8 or (len(distances) > 0 and np.ptp(distances) == 0))


class _Grid(NamedTuple):
    """The even times that are nearest to those of a file.

    Their rate [Hz], and whether it is round, or the known one; the usual step [s]; range [s] and
    root mean square (in sampling intervals) of the deviations from them.
    """

    rate: float
    agrees: bool
    usual: float
    spread: float
    jitter: float


def _fitted(seconds: Times, steps: Times, tick: float, fs: float | None) -> _Grid:
    """Return the even times at `fs`, or the roundest rate that agrees, else at the mean rate."""
    n = np.arange(len(seconds)) - (len(seconds) - 1) / 2
    slope = float(n @ seconds / (n @ n))
    usual = float(np.quantile(steps[steps > 1e-6 * slope], 0.49, method="lower"))

    def spread(rate: float) -> float:
        return float(np.ptp(seconds - n / rate))

    limit = max(tick, 1.05 * spread(1 / slope)) + (0.1 if fs else 1e-6) * usual
    rates = [fs] if fs else [*(float(f"{1 / slope:.{k}g}") for k in range(2, 7)), 1 / slope]
    rate = next((rate for rate in rates if spread(rate) <= limit), 1 / slope)
    deviations = seconds - n / rate
    return _Grid(rate, rate in rates, usual, spread(rate), float(np.std(deviations) * rate))


def _tick(times: Times, steps: Times) -> float:
    """Return the coarsest decimal of which all times are multiples; 0 if there is none."""
    changed = times[1:][steps > 0]
    changed = np.concatenate([changed[:500], changed[:: len(changed) // 500 + 1]])
    smallest = steps.min(where=steps > 0, initial=np.inf)
    for multiples, decimal in ((changed * 10.0**n, 10.0**-n) for n in range(10)):
        is_whole = np.allclose(multiples, np.rint(multiples), rtol=0, atol=1e-3)
        if is_whole and 0.9 * decimal < smallest < np.inf:
            return decimal
    return 0.0


def _found(
    seconds: Times,
    long: NDArray[np.bool_],
    equal: NDArray[np.bool_],
    grid: _Grid,
    fs: float | None,
) -> str:
    """Say what is wrong with times, where, and the remedy."""
    steps = np.diff(seconds)
    places = np.flatnonzero(equal if equal.any() else long)
    place = int(places[0]) if len(places) else int(np.argmax(np.abs(steps - grid.usual)))
    step = f"{steps[place]:.6g} s after sample {place} ({seconds[place]:.6g} s)"
    if equal.any():
        return (
            f": several samples share one time, as in packets: {len(places)} steps are 0, first "
            f"that of {step}. If they were sampled evenly, their rate is {grid.rate:.6g} Hz. Give "
            f"each sample its time"
        )
    if len(places):
        missing = int(np.rint(steps[long] / grid.usual - 1).sum())
        distances = np.diff(places)
        is_regular = len(places) > 2 and np.ptp(distances) == 0
        every = f" (one of {distances[0] + 1})" if is_regular else ""
        remedy = "Cut the recording there, or correct the clock"
        if steps.max() < 3.5 * grid.usual:
            remedy += ", set resample = true to fill one or two samples"
            remedy += f", state fs = {grid.rate:.6g} if only rounding makes steps longer"
        return (
            f", with a gap of {step}; usual are {grid.usual:.6g} s. At {1 / grid.usual:.6g} Hz, "
            f"{missing} of {len(seconds) + missing} samples are missing{every}. {remedy}"
        )
    if fs and not grid.agrees:
        return f" at {fs:.9g} Hz: its mean rate is {grid.rate:.9g} Hz. Correct fs"
    return (
        f" at {grid.rate:.9g} Hz: by jitter or drift, its times are {grid.jitter:.0%} of a step "
        f"(rms) from even ones, with a step of {step}; usual are {grid.usual:.6g} s. Set "
        f"resample = true in the layout"
    )


def ignore_hint(name: str) -> str:
    """Say how times are ignored."""
    return f"state fs, and time = false (in Python: False) to ignore {name!r}"
