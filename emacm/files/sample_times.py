"""Times of samples, and their rate."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._checks import check_finite
from emacm.recordings.names import unit_factor

Times = NDArray[np.float64]


def seconds_of(values: NDArray[Any], unit: str, name: str) -> Times:
    """Return a column of times in seconds since the first.

    Parameters
    ----------
    values : ndarray of shape (n_times,)
        Numbers, or dates and times as in `dates_of`.
    unit : str
        Unit of numbers; "" stands for s, or for ms if that is a word of the name.
    name : str
        Name of the column, for messages.

    Returns
    -------
    ndarray of shape (n_times,)

    Raises
    ------
    ValueError
        If a value is missing or is not a time, or has no unit and cannot be in seconds.
    """
    if values.dtype.kind in "iuf":
        factor = unit_factor(time_unit(name, unit), "time")
        if not unit and len(values) and values[0] * factor > 1e11:  # s since 1970: in 5138
            raise ValueError(
                f"time column {name!r} begins at {values[0]:g}, which cannot be in s. State its "
                f"unit, as in units = {{{name!r}: 'ms'}} of the layout, or {_ignore(name)}."
            )
        seconds = values.astype(np.float64) * factor
    else:
        dates = dates_of(values, name)
        seconds = (dates - dates.iloc[0]).dt.total_seconds().to_numpy()
    check_finite(seconds, f"time column {name!r}")
    return seconds - seconds[0]


def time_unit(name: str, stated: str) -> str:
    """Return the unit of a column of times: as stated, else ms if the name says so, else s.

    Examples
    --------
    >>> time_unit("time_ms", ""), time_unit("time", ""), time_unit("time_ms", "us")
    ('ms', 's', 'us')
    """
    return stated or ("ms" if "ms" in re.findall("[a-z]+", name.lower()) else "s")


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
        Dates, or texts such as "2026-11-01T08:01:00.0001", "01.11.2026 08:01:00,0001" (day first)
        or "08:01:00.0001"; where a time of day goes back by more than 12 h, the next day begins.
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
        texts = texts.astype(str).str.strip().str.replace(",", ".", regex=False)
        if re.match(r"\d\d?:", texts.iloc[0]):
            hours = pd.to_timedelta(texts, errors="coerce")
            midnights = (hours.diff() < pd.Timedelta(hours=-12)).cumsum()
            dates = pd.Timestamp(0) + hours + pd.to_timedelta(midnights, unit="D")
        else:
            texts = texts.str.replace(r"^(\d+)\.(\d+)\.(\d{4})\b", r"\3-\2-\1", regex=True)
            dates = pd.to_datetime(texts, errors="coerce", format="ISO8601")
    if dates.isna().any():
        is_number = np.array([isinstance(value, float) for value in values])
        place = int(np.argmin(is_number) if is_number[0] else np.argmax(dates.isna()))
        raise ValueError(
            f"time column {name!r} has {values.tolist()[place]!r} at sample {place}, not a time. "
            f"Repair it, or {_ignore(name)}."
        )
    return dates


def _ignore(name: str) -> str:
    return f"state fs, and time = false (in Python: False) to ignore {name!r}"


def rate_of_times(seconds: Times, name: str, fs: float | None = None) -> float:
    """Return the sampling rate of evenly spaced times.

    Parameters
    ----------
    seconds : ndarray of shape (n_times,)
        Times [s].
    name : str
        Name of the column, for messages.
    fs : float, optional
        Rate [Hz] that they must have.

    Returns
    -------
    float
        `fs`, or the mean rate [Hz], rounded if this agrees with all times.

    Raises
    ------
    ValueError
        If times do not increase, have gaps or jitter of over a tenth of a sampling interval, or
        contradict `fs`, or are rounded so much that they leave over 1 % of the rate open; the
        message names the sample.

    Examples
    --------
    >>> rate_of_times(np.round(np.arange(5) / 12_000, 6), "time")
    12000.0
    """
    steps = np.diff(seconds)
    if len(seconds) < 2 or steps.min() < 0 or not steps.any():
        place = int(np.argmax(steps < 0)) + 1 if len(steps) else 0
        raise ValueError(
            f"time column {name!r} does not increase at sample {place}, {seconds[place]:.6g} s. "
            f"Choose the column of times, sort or cut the recording, or {_ignore(name)}."
        )
    rate = float((len(seconds) - 1) / (seconds[-1] - seconds[0]))
    resolution = _rounding(seconds)
    n = np.arange(len(seconds))
    if fs is None and resolution > max(0.01 * seconds[-1], 1.5 / rate):
        raise ValueError(
            f"time column {name!r} is rounded to {resolution:g} s, which leaves the sampling rate "
            f"open: about {rate:.3g} Hz. State fs, and time = false (in Python: False)."
        )
    for digits in range(2, 7):  # digits of a round rate
        nominal = float(f"{rate:.{digits}g}")
        if fs is None and np.abs(seconds - n / nominal).max() <= resolution + 1e-6 / nominal:
            return nominal
    candidate = rate if fs is None else fs
    if np.abs(seconds - n / candidate).max() <= 0.1 / candidate + resolution:
        return candidate
    usual = float(np.median(steps))
    place = int(np.argmax(np.abs(steps - usual)))
    raise ValueError(
        f"time column {name!r} is not evenly spaced at {candidate:.9g} Hz: its mean rate is "
        f"{rate:.9g} Hz, with a gap of {steps[place]:.6g} s after sample {place} "
        f"({seconds[place]:.6g} s); usual are {usual:.6g} s. Correct fs, cut the recording at the "
        f"gap, resample it to even times, or {_ignore(name)}."
    )


def _rounding(seconds: Times) -> float:
    """Return by how much times are rounded [s]: the coarsest decimal of which all are multiples.

    Where 90 % of the steps are equal, and less than five such decimals, they are exact: the rate is
    a round one, and the other steps are gaps.
    """
    decimal, steps = 1e-9, np.diff(seconds)
    smallest = float(steps[steps > 0].min())
    for digits in range(9):
        multiples = seconds[:1000] * 10.0**digits
        whole = np.allclose(multiples, np.rint(multiples), rtol=0, atol=1e-3)
        if whole and smallest * 10.0**digits > 0.9:
            decimal = 10.0**-digits
            break
    usual = float(np.median(steps))
    are_equal = np.mean(np.abs(steps - usual) < decimal / 2) > 0.9
    return 0.0 if decimal / 2 < usual < 5 * decimal and are_equal else decimal
