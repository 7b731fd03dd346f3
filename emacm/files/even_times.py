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
    resolution: float = 0.0,
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
    resolution : float
        To what the times are rounded by the type of their numbers [s]. Decimals are found.
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
    if not steps.any() or steps.min() < 0:
        place = int(np.argmax(steps < 0)) + 1 if len(steps) else 0
        raise ValueError(
            f"time column {name!r} does not increase at sample {place}, {seconds[place]:.6g} s. "
            f"Choose the column of times, sort or cut the recording, or {ignore_hint(name)}."
        )
    tick = _coarsest_decimal(seconds[1:][steps > 0], steps[steps > 0].min())
    tick = max(resolution, tick if np.ptp(steps) > 0.1 * tick else 0.0)  # else equal
    n = np.arange(len(seconds))
    few = len(steps) <= 100  # then jitter hides the rate
    if fs and np.abs(seconds - n / fs).max() <= (0.5 if few else 0.1) / fs + tick:
        return EvenTimes(fs)
    rate, usual = _fitted_rate(seconds, steps, tick, fs)
    deviations = seconds - n / rate
    spread, jitter = float(np.ptp(deviations)), float(np.std(deviations) * rate)
    long, equal = steps > 1.75 * usual, steps <= 1e-6 * usual
    long[:-1] &= steps[1:] > 0.5 * usual  # a single late sample is jitter,
    long &= np.std(steps[~long]) < 0.2 * usual  # and so are all if the others vary, too
    is_rounded = bool(spread <= 1.05 * tick and np.ptp(steps) < 1.5 * tick)
    if is_rounded and tick > max(0.01 * seconds[-1], 1.5 / rate):
        raise ValueError(
            f"time column {name!r} is rounded to {tick:g} s, which leaves the sampling rate "
            f"open: about {rate:.3g} Hz. State fs, and time = false (in Python: False)."
        )
    # Rounding, too, makes some steps longer, or zero. It is told from missing samples and packets
    # by many such steps, at distances that differ; times in ms often have equally many samples.
    singles = ~equal if tick > 1.5e-3 else equal[:0]
    is_rounded = is_rounded and not (long.any() and _are_few(long, long))
    is_rounded = is_rounded and not (equal.any() and _are_few(equal, singles))
    is_filled = resample and not equal.any() and steps.max() < 3.5 * usual
    if not is_rounded and is_filled and (long.any() or jitter > 0.005):
        filled = float(f"{np.rint(steps / usual).sum() / seconds[-1]:.4g}")
        if not fs or abs(fs / filled - 1) < 0.05:  # lower rates would need a filter
            return EvenTimes(fs or filled, seconds)
    is_even = is_rounded or not (long.any() or equal.any() or jitter > most_jitter)
    if not is_even or fs not in (None, rate):
        marked = equal if equal.any() else long if long.any() else np.abs(steps - usual)
        place = int(np.argmax(marked))
        step = f"{steps[place]:.6g} s after sample {place} ({seconds[place]:.6g} s)"
        is_rounding = tick > 0.3 * usual and (equal.any() or not 0 < np.mean(long) < 0.05)
        if gap := _gap_in_rounded(seconds, tick) if is_rounding and not is_even else "":
            found = gap
        elif is_even:
            found = f" at {fs:.9g} Hz: its mean rate is {rate:.6g} Hz. Correct fs"
        elif equal.any():
            found = f": several samples share one time, as in packets: {equal.sum()} steps are 0, "
            found += f"first that of {step}. If they were sampled evenly, their rate is "
            found += f"{rate:.6g} Hz. Give each sample its time"
        elif long.any():
            missing = int(np.rint(steps[long] / usual - 1).sum())
            found = f", with a gap of {step}; usual are {usual:.6g} s. At {1 / usual:.6g} Hz, "
            found += f"{missing} of {len(n) + missing} samples are missing. Cut the recording "
            found += "there, or correct the clock"
            if steps.max() < 3.5 * usual:
                found += ", set resample = true to fill one or two samples"
            if tick > 0.5 * usual:
                found += f", state fs = {rate:.6g} if only rounding makes steps longer"
        else:
            found = f" at {rate:.9g} Hz: by jitter or drift, its times are {jitter:.0%} of a step "
            found += f"(rms) from even ones, with a step of {step}; usual are {usual:.6g} s. Set "
            found += "resample = true in the layout"
        raise ValueError(
            f"time column {name!r} is not evenly spaced{found}; or {ignore_hint(name)}."
        )
    if fs is None and is_rounded and spread > 0.1 * tick and tick > 1e-5 * seconds[-1]:
        text = f"are rounded to {tick:.6g} s: the rate is {rate:.9g} Hz within "
        text += f"{tick / seconds[-1]:.1g} of it. State fs if it is known better."
        warn("times", f"times {name!r} {text}")
    elif fs is None and not is_rounded and jitter > 0.005:
        text = f"jitter by {jitter:.1%} of a sampling interval (rms), and are taken as even at"
        text += f" {rate:.9g} Hz: an error of {np.pi * jitter:.0%} near half this rate. "
        warn("times", f"times {name!r} {text}Set resample = true if they are those of the samples.")
    return EvenTimes(rate)


def _are_few(odd: NDArray[np.bool_], regular: NDArray[np.bool_]) -> bool:
    """Tell whether there are less than 8 odd steps, or regular ones all at one distance."""
    distances = np.diff(np.flatnonzero(regular))
    return bool(odd.sum() < 8 or (len(distances) > 0 and np.ptp(distances) == 0))


def _gap_in_rounded(seconds: Times, tick: float) -> str:
    """Say where samples are missing beside steps that are rounded; "" if there is no gap.

    The means of the times on both sides of a gap are apart by more than elsewhere, whatever they
    are rounded to.
    """
    width = max(50, int(20 * tick * len(seconds) / seconds[-1]))
    if len(seconds) < 4 * width:
        return ""
    sums = np.cumsum(np.insert(seconds, 0, 0.0))
    means = (sums[width:] - sums[:-width]) / width
    apart = means[width:] - means[:-width]
    usual, largest = float(np.median(apart)) / width, int(np.argmax(apart))
    missing = round(apart[largest] / usual - width)
    if missing < 1:
        return ""
    first = max(largest + width - 4, 0)
    place = first + int(np.argmax(np.diff(seconds[first : first + 9])))
    return (
        f", with a gap of {(missing + 1) * usual:.3g} s after sample {place} ({seconds[place]:.6g} "
        f"s), besides being rounded to {tick:g} s; samples missing there: {missing}, at "
        f"{float(f'{1 / usual:.4g}'):g} Hz. Cut the recording there, or correct the clock"
    )


def _fitted_rate(
    seconds: Times, steps: Times, tick: float, fs: float | None
) -> tuple[float, float]:
    """Return `fs` or the roundest rate that agrees, else the mean rate; and the usual step."""
    n = np.arange(len(seconds)) - (len(seconds) - 1) / 2
    slope = float(n @ seconds / (n @ n))
    usual = float(np.quantile(steps[steps > 1e-6 * slope], 0.49, method="lower"))
    limit = max(tick, 1.05 * np.ptp(seconds - n * slope)) + (0.1 if fs else 1e-6) * usual
    rates = [fs] if fs else [float(f"{1 / slope:.{digits}g}") for digits in range(2, 7)]
    fitting = (rate for rate in rates if np.ptp(seconds - n / rate) <= limit)
    return next(fitting, 1 / slope), usual


def _coarsest_decimal(times: Times, smallest: float) -> float:
    """Return the coarsest decimal of which times are multiples, in s to days; 0 if there is none.

    The last times decide: those of six digits are finer at the start.
    """
    last = times[-max(500, len(times) // 10) :]
    last = last[:: len(last) // 1000 + 1]
    units = [unit * 10.0**-n for n in range(10) for unit in (86_400, 3600, 60, 1)]
    for unit in sorted(units, reverse=True):
        multiples = last / unit
        if 0.9 * unit < smallest and np.abs(multiples - np.rint(multiples)).max() < 1e-3:
            return unit
    return 0.0


def ignore_hint(name: str) -> str:
    """Say how times are ignored."""
    return f"state fs, and time = false (in Python: False) to ignore {name!r}"
