"""Times of samples: how they are read, and whether they are even.

All types of files use this decision. A channel has one rate, so that times that are not even are
explained (by rounding), stated (small jitter), resampled on request, or refused with what was
found, where, and the remedy.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy  # scipy.interpolate is imported when it is used
from numpy.typing import NDArray

from emacm._checks import check_finite
from emacm._statements import warn
from emacm.recordings.names import unit_factor

Times = NDArray[np.float64]


def seconds_of(values: NDArray[Any], unit: str, name: str) -> tuple[Times, float]:
    """Return a column of times in seconds since the first, and to what their type rounds them.

    Parameters
    ----------
    values : ndarray of shape (n_times,)
        Numbers, or dates and times as in `dates_of`.
    unit : str
        Unit of numbers.
    name : str
        Name of the column, for messages.

    Returns
    -------
    times : ndarray of shape (n_times,)
    resolution : float
        [s]

    Raises
    ------
    ValueError
        If a value is missing or is not a time.
    """
    resolution = 0.0
    if values.dtype.kind in "iuf":
        factor = unit_factor(unit, "time")
        seconds = (values - values[:1]).astype(np.float64) * factor  # exact also of ns since 1970
        if values.dtype.kind == "f" and len(values):
            resolution = float(np.spacing(np.abs(values[[0, -1]]).max())) * factor
    else:
        dates = dates_of(values, name)
        seconds = (dates - dates.iloc[0]).dt.total_seconds().to_numpy()
    check_finite(seconds, f"time column {name!r}")
    return seconds, resolution


def unit_that_fits(values: NDArray[Any], speed: float = 0.0) -> str:
    """Return the unit in which times without a unit give a credible rate; "" if that is s.

    Parameters
    ----------
    values : ndarray of shape (n_times,)
        The times.
    speed : float
        Highest speed of the shaft [rev/s], 0 if it is not known.

    Returns
    -------
    str
        Among units with a rate of 100 Hz to 1 MHz that is above twice the speed, that with the
        roundest rate; of times since 1970, that of their size.

    Examples
    --------
    >>> unit_that_fits(np.arange(900) / 86.4e6), unit_that_fits(np.arange(900))
    ('d', 'ms')
    """
    is_number = values.dtype.kind in "iuf" and len(values) > 1
    first, span = (float(values[0]), float(values[-1] - values[0])) if is_number else (0.0, 0.0)
    if first > 1e11:  # since 1970; in s, it would be the year 5138
        return "ms" if first < 1e14 else "us" if first < 1e17 else "ns"
    if len(values) < 100 or not span > 0:  # a table of a few rows
        return ""
    rate = (len(values) - 1) / span
    units: tuple[str, ...] = ()
    if rate > 1e6 or span < min(0.1, 1 / speed if speed else 0):
        units = ("d", "h", "min")
    elif rate <= max(1.001, 2 * speed):
        units = ("ms", "us", "ns")
    rates = {unit: rate / unit_factor(unit, "time") for unit in units}
    lengths = {
        unit: len(f"{value:.3e}".partition("e")[0].rstrip("0."))
        for unit, value in rates.items()
        if max(99, 2 * speed) < value <= 1.001e6
    }
    return min(lengths, key=lengths.__getitem__, default="")


def stated_date(value: Any, key: str) -> pd.Timestamp:
    """Return the date that the meta of a file states under a key.

    Raises
    ------
    ValueError
        If it is no date.
    """
    try:
        return dates_of(np.array([str(value)]), key).iloc[0]
    except ValueError as error:
        raise ValueError(
            f"{key} = {value!r} is not a time, such as 2026-11-01T08:01 or 01.11.2026 08:01. "
            f"Correct the name of the file, or the table of meta."
        ) from error


def dates_of(values: NDArray[Any], name: str) -> pd.Series:
    """Return dates and times of day as dates; a time of day without a date is on 1970-01-01.

    Parameters
    ----------
    values : ndarray of shape (n_times,)
        Dates, or texts such as "2026-11-01T08:01:00.0001", "01.11.2026 08:01:00,0001" (day first,
        as with slashes and a decimal comma) or "08:01:00.0001"; where a time of day goes back by
        more than 12 h, the next day begins. Offsets from UTC may change.
    name : str
        Name of the column, for messages.

    Returns
    -------
    Series of dates

    Raises
    ------
    ValueError
        If a value is missing or is not a time.

    Examples
    --------
    >>> dates_of(np.array(["23:59:59,5", "0:00:00,5"]), "time").tolist()
    [Timestamp('1970-01-01 23:59:59.500000'), Timestamp('1970-01-02 00:00:00.500000')]
    """
    dates = texts = pd.Series(values)
    if values.dtype.kind != "M":
        texts = texts.astype(str).str.strip()
        has_comma = "," in texts.iloc[0]  # as where the day is first
        texts = texts.str.replace(",", ".", regex=False)
        texts = texts.str.replace(r"\s+", " ", regex=True)
        if slashes := re.match(r"(\d\d?)/(\d\d?)/\d{4}\b", texts.iloc[0]):
            if int(slashes[1]) <= 12 and int(slashes[2]) <= 12 and not has_comma:
                raise ValueError(
                    f"time column {name!r} has {texts.iloc[0]!r}, whose day and month are not "
                    f"known. Write 2026-11-01 or 01.11.2026, or {ignore_hint(name)}."
                )
            day_first = r"\2.\1.\3" if int(slashes[2]) > 12 else r"\1.\2.\3"
            texts = texts.str.replace(r"^(\d+)/(\d+)/(\d{4})\b", day_first, regex=True)
        if re.match(r"\d\d?:", texts.iloc[0]):
            hours = pd.to_timedelta(texts, errors="coerce")
            midnights = (hours.diff() < pd.Timedelta(hours=-12)).cumsum()
            dates = pd.Timestamp(0) + hours + pd.to_timedelta(midnights, unit="D")
        else:
            texts = texts.str.replace(r"^(\d+)\.(\d+)\.(\d{4})\b", r"\3-\2-\1", regex=True)
            has_zone = re.search(r"(Z|[+-]\d\d:?\d\d)$", texts.iloc[0]) is not None
            form = "ISO8601"
            if re.search(r" [AP]M$", texts.iloc[0]):
                form = f"%Y-%m-%d %I:%M:%S{'.%f' if '.' in texts.iloc[0] else ''} %p"
            dates = pd.to_datetime(texts, errors="coerce", format=form, utc=has_zone)
    if dates.isna().any():
        is_number = np.array([isinstance(value, float) for value in values])
        place = int(np.argmin(is_number) if is_number[0] else np.argmax(dates.isna()))
        raise ValueError(
            f"time column {name!r} has {values.tolist()[place]!r} at sample {place}, not a time. "
            f"Repair it, or {ignore_hint(name)}."
        )
    return dates


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
    seconds: Times, resolution: float, name: str, fs: float | None = None, *, resample: bool = False
) -> EvenTimes:
    """Return the sampling rate of times, if they are even.

    Parameters
    ----------
    seconds : ndarray of shape (n_times,)
        Times, from 0 [s].
    resolution : float
        To what the times are rounded by the type of their numbers [s]. Decimals are found.
    name : str
        Name of the column, for messages.
    fs : float, optional
        Rate [Hz] that they must have.
    resample : bool
        Whether samples may be resampled, so that jitter and single missing samples are allowed.

    Returns
    -------
    EvenTimes
        With the rate `fs`, or the roundest rate that agrees with all times.

    Raises
    ------
    ValueError
        If times do not increase, have gaps (intervals near multiples of the usual one, however
        regular), are shared by several samples, jitter by more than a tenth of a sampling interval
        (root mean square; the error of a sine at a quarter of the rate is π/2 times as large),
        contradict `fs`, or are rounded so much that they leave over 1 % of the rate open; the
        message names the sample.

    Warns
    -----
    EmacmWarning
        If rounding leaves more than 1e-5 of the rate open, or there is jitter above 0.5 % of a
        sampling interval; not if `fs` is given.

    Examples
    --------
    >>> even_times(np.round(np.arange(12_000) / 12_000, 6), 0.0, "time").rate
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
    is_even = is_rounded or not (long.any() or equal.any() or jitter > 0.1)
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
