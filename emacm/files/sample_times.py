"""Times of samples, and their rate."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._checks import check_finite
from emacm.files.even_times import Times, ignore_hint
from emacm.recordings.names import unit_factor


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
