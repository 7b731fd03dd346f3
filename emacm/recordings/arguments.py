"""Checks of the arguments of `Recording`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from mmap import mmap
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._checks import check_number, check_signal, check_unique_columns
from emacm.recordings.names import is_time_name
from emacm.shaft.angle import angle_from_wrapped, is_wrapped
from emacm.shaft.motion import Series


def check_signals(signals: Any) -> dict[str, NDArray[np.floating]]:
    """Return the channels by name as finite, immutable arrays."""
    if isinstance(signals, pd.DataFrame):
        check_unique_columns(signals, "signals")
        signals = {name: signals[name] for name in signals.columns}
        _refuse_other_columns(signals)
    if not isinstance(signals, Mapping):
        raise TypeError(
            f"signals must be a mapping of channel name to 1-D array, or a DataFrame; "
            f"got {type(signals).__name__}."
        )
    if not signals:
        raise ValueError("signals is empty; a recording needs at least one channel.")
    for name in signals:
        if not isinstance(name, str) or not name:
            raise TypeError(f"channel names must be non-empty strings, got {name!r}.")
    return {
        name: immutable(check_signal(values, f"channel {name!r}"))
        for name, values in signals.items()
    }


def _refuse_other_columns(columns: Mapping[Any, pd.Series]) -> None:
    """Raise a ValueError if a column of a table that was passed as a whole is not a channel."""
    for name, values in columns.items():
        text = str(name)
        if is_time_name(text) and values.dtype.kind in "iufmM" and values.is_monotonic_increasing:
            is_what, remedy = "the time of the samples", ""
        elif "rpm" in re.findall("[a-z]+", text.lower()):
            is_what, remedy = "the speed of the shaft", f", velocity=frame[{name!r}] * np.pi / 30"
        else:
            continue
        raise ValueError(
            f"column {name!r} of signals is named like {is_what}, not like a channel. Pass "
            f"frame.drop(columns=[{name!r}]){remedy}; if it is a channel, pass dict(frame)."
        )


def check_rates(fs: Any, channels: tuple[str, ...]) -> dict[str, float]:
    """Return the sampling rate of each channel [Hz]."""
    if not isinstance(fs, Mapping):
        rate = check_number(fs, "fs", above=0, unit="Hz")
        return dict.fromkeys(channels, rate)
    if set(fs) != set(channels):
        raise ValueError(f"fs must give a rate for each of {list(channels)}, but has {list(fs)}.")
    return {
        name: check_number(fs[name], f"fs of channel {name!r}", above=0, unit="Hz")
        for name in channels
    }


def check_units(units: Any, channels: tuple[str, ...]) -> dict[str, str]:
    """Return the units of the channels for which one is given."""
    if not isinstance(units, Mapping | None):
        raise TypeError(f"units must map channels to units, as {{'current': 'A'}}, got {units!r}.")
    for name, unit in (units or {}).items():
        if name not in channels:
            raise ValueError(
                f"units names {name!r}, which is not a channel; the channels are {list(channels)}."
            )
        if not isinstance(unit, str):
            raise TypeError(f"the unit of channel {name!r} must be a text as 'g', got {unit!r}.")
    return dict(units or {})


def check_shaft(angle: Any, velocity: Any, n_times: int) -> tuple[str, NDArray[np.floating]]:
    """Return which shaft reference was given, "angle" or "velocity", and its samples.

    A velocity that is a number is constant over `n_times` samples.
    """
    if (angle is None) == (velocity is None):
        came = "neither" if angle is None else "both"
        raise ValueError(
            f"exactly one of angle and velocity must be given, got {came}. The functions of "
            f"emacm.shaft compute one from a tachometer, a resolver, a position or currents."
        )
    if isinstance(velocity, Real) and not isinstance(velocity, bool):
        speed = check_number(velocity, "velocity", unit="rad/s")
        return "velocity", immutable(np.full(n_times, speed))
    if angle is None:
        return "velocity", immutable(check_signal(velocity, "velocity"))
    shaft = check_signal(angle, "angle")
    if is_wrapped(shaft):
        return "angle", immutable(angle_from_wrapped(shaft))
    steps, span = np.abs(np.diff(shaft)), np.ptp(shaft)
    # Of fewer samples, a single step may be most of the range.
    if len(shaft) >= 10 and steps.max() > max(span / 2, np.pi):
        raise ValueError(
            f"angle jumps by {steps.max():.4g} after sample {int(steps.argmax())}, which is most "
            f"of its whole range ({span:.4g}). Is it wrapped, in degrees, in counts or "
            f"with noise? Pass emacm.angle_from_wrapped(angle, period=...), in rad."
        )
    return "angle", immutable(shaft)


def check_shaft_rate(shaft_fs: Any, rates: Mapping[str, float]) -> float:
    """Return the sampling rate of the shaft reference [Hz]; by default, that of the channels."""
    if shaft_fs is not None:
        return check_number(shaft_fs, "shaft_fs", above=0, unit="Hz")
    if len(set(rates.values())) > 1:
        raise ValueError(
            f"shaft_fs must be given where the channels have different rates, got fs={dict(rates)}."
        )
    return next(iter(rates.values()))


def check_durations(series: Mapping[str, tuple[Series, float]]) -> None:
    """Raise a ValueError if durations differ by more than one sample.

    Parameters
    ----------
    series : mapping of str to (Series, float)
        Channels and the shaft reference by their names in messages, each with its rate [Hz].
    """
    lasting = {name: (len(values) / rate, rate) for name, (values, rate) in series.items()}
    longest = max(lasting, key=lambda name: lasting[name][0])
    whole, its_rate = lasting[longest]
    for name, (duration, rate) in lasting.items():
        if whole - duration > (1 + 1e-9) / min(rate, its_rate):
            raise ValueError(
                f"durations must agree within one sample, but {name} lasts {duration:.9g} s and "
                f"{longest} {whole:.9g} s. Check fs and shaft_fs, or cut the longer one."
            )


def check_indices(series: Mapping[str, tuple[Any, float]]) -> None:
    """Check that the indices of pandas objects agree with the rates and with one another.

    Parameters
    ----------
    series : mapping of str to (array-like, float)
        Channels and shaft reference as given, by their names in messages, each with its rate [Hz];
        those without an index, or numbered from 0, are not checked.

    Raises
    ------
    ValueError
        If times of an index contradict the rate, or indices do not start at the same time.
    """
    indexed = [
        (name, values.index, rate)
        for name, (values, rate) in series.items()
        if isinstance(values, pd.Series) and not values.index.equals(pd.RangeIndex(len(values)))
    ]
    for name, index, rate in indexed:
        if isinstance(index, pd.DatetimeIndex | pd.TimedeltaIndex):
            _check_times(index, rate, name)
        other, other_index, other_rate = indexed[0]
        differ = name != other and index[0] != other_index[0]
        if isinstance(index, pd.DatetimeIndex | pd.TimedeltaIndex) and differ:
            apart = abs((index[0] - other_index[0]) / pd.Timedelta(1, "s"))
            differ = apart > (1 + 1e-9) / min(rate, other_rate)
        if differ:
            raise ValueError(
                f"{name} and {other} have different indices: {name} starts at {index[0]}, {other} "
                f"at {other_index[0]}. Channels and shaft must start at the same time. Align them "
                f"by their index, or pass .to_numpy() if they are aligned."
            )


def _check_times(index: Any, rate: float, name: str) -> None:
    """Refuse times that deviate from the rate by more than 0.6 of a sampling interval."""
    seconds = np.asarray((index - index[0]) / pd.Timedelta(1, "s"))
    off = ~(np.abs(seconds - np.arange(len(index)) / rate) <= 0.6 / rate)  # also if missing
    if off.any():
        place = int(np.argmax(off))
        raise ValueError(
            f"the index of {name} contradicts fs = {rate:g} Hz: sample {place} is at "
            f"{seconds[place]:.6g} s, expected was {place / rate:.6g} s. Correct fs, or resample "
            f"to uniform times and fill the gaps."
        )


def immutable(array: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return an array that nobody can write to: the given one, or a copy.

    Read-only arrays are kept as they are if the memory is theirs, of an array that is read-only
    too, of `bytes`, or of a memory map that was opened read-only.
    """
    owner: Any = array
    while isinstance(owner, np.ndarray) and not owner.flags.writeable:
        owner = owner.base
    is_mapped = isinstance(owner, mmap) and memoryview(owner).readonly
    if owner is None or is_mapped or isinstance(owner, bytes):
        return array
    return np.frombuffer(array.tobytes(), array.dtype).reshape(array.shape)
