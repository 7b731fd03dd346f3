"""Checks of the arguments of `Recording`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._checks import check_number, check_signal, check_unique_columns
from emacm.recordings.digests import is_mapped
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
        if not isinstance(name, str):
            continue
        if is_time_name(name) and values.dtype.kind in "iufmM" and values.is_monotonic_increasing:
            is_what, remedy = "the time of the samples", ""
        elif "rpm" in re.findall("[a-z]+", name.lower()):
            is_what, remedy = "the speed of the shaft", f", velocity=frame[{name!r}] * np.pi / 30"
        else:
            continue
        raise ValueError(
            f"column {name!r} of signals is named like {is_what}, not like a channel. Pass "
            f"frame.drop(columns=[{name!r}]){remedy}; if it is a channel, pass a mapping: "
            f"dict(frame)."
        )


def check_rates(fs: Any, channels: tuple[str, ...]) -> dict[str, float]:
    """Return the sampling rate of each channel [Hz]."""
    if not isinstance(fs, Mapping):
        rate = check_number(fs, "fs", above=0, unit="Hz")
        return dict.fromkeys(channels, rate)
    if set(fs) != set(channels):
        raise ValueError(
            f"fs must give a rate for each channel: channels are {list(channels)}, "
            f"rates are given for {list(fs)}."
        )
    return {
        name: check_number(fs[name], f"fs of channel {name!r}", above=0, unit="Hz")
        for name in channels
    }


def check_units(units: Any, channels: tuple[str, ...]) -> dict[str, str]:
    """Return the units of the channels for which one is given."""
    if units is None:
        return {}
    if not isinstance(units, Mapping):
        raise TypeError(f"units must map channels to units, as {{'current': 'A'}}, got {units!r}.")
    for name, unit in units.items():
        if name not in channels:
            raise ValueError(
                f"units names {name!r}, which is not a channel; the channels are {list(channels)}."
            )
        if not isinstance(unit, str) or not unit:
            raise TypeError(
                f"the unit of channel {name!r} must be a text such as 'g', got {unit!r}."
            )
    return dict(units)


def constant_speed(
    velocity: Any, channels: Mapping[str, Series], rates: Mapping[str, float], shaft_fs: Any
) -> Any:
    """Return a velocity that is a number as an array over the duration of the channels.

    Examples
    --------
    >>> constant_speed(157.0, {"vibration": np.zeros(3)}, {"vibration": 2.0}, None)
    array([157., 157., 157.])
    """
    if isinstance(velocity, bool | np.bool_) or not isinstance(velocity, Real):
        return velocity
    speed = check_number(velocity, "velocity", unit="rad/s")
    fastest = max(rates, key=lambda name: rates[name])
    n_times = len(channels[fastest])
    if shaft_fs is not None:
        n_times = max(2, round(n_times / rates[fastest] * check_shaft_rate(shaft_fs, rates)))
    return np.full(n_times, speed)


def check_shaft(
    angle: Any, velocity: Any, *, fastest: float = 1e9
) -> tuple[str, NDArray[np.floating]]:
    """Return which shaft reference was given, "angle" or "velocity", and its samples.

    No shaft is as fast as `fastest` [rad/s].
    """
    if (angle is None) == (velocity is None):
        came = "neither" if angle is None else "both"
        raise ValueError(
            f"exactly one of angle and velocity must be given, got {came}. The functions of "
            f"emacm.shaft compute one from a tachometer, a resolver, a position or currents."
        )
    if angle is None:
        speed = check_signal(velocity, "velocity")
        place = int(np.abs(speed).argmax())
        if abs(speed[place]) > fastest:
            raise ValueError(
                f"velocity must be in rad/s, got {speed[place]:.4g} at sample {place}, which no "
                f"shaft reaches. Check its unit, or repair the sample."
            )
        return "velocity", immutable(speed)
    shaft = check_signal(angle, "angle")
    _check_resolution(shaft)
    if is_wrapped(shaft):
        return "angle", immutable(angle_from_wrapped(shaft))
    steps = np.abs(np.diff(shaft))
    # Of fewer samples, a single step may be most of the range.
    if len(shaft) >= 10 and steps.max() > max(np.ptp(shaft) / 2, np.pi):
        raise ValueError(
            f"angle jumps by {steps.max():.4g} after sample {int(steps.argmax())}, which is most "
            f"of its whole range ({np.ptp(shaft):.4g}). Is it wrapped, in degrees, in counts or "
            f"with noise? Pass emacm.angle_from_wrapped(angle, period=...), in rad."
        )
    return "angle", immutable(shaft)


def _check_resolution(angle: NDArray[np.floating]) -> None:
    """Raise a ValueError where the steps of an angle are lost in the rounding of its values."""
    largest = float(np.abs(angle).max())
    if largest > 1e15:  # float64 resolves no tenth of a radian there
        raise ValueError(
            f"angle must be in rad, got values up to {largest:.4g}, which no shaft reaches. "
            f"Check its unit, and subtract the angle of the first sample."
        )
    dtype, rounding = angle.dtype, float(np.spacing(angle.dtype.type(largest)))
    step = float(np.ptp(angle)) / (len(angle) - 1)
    if rounding > 1e-9 and rounding > step * (1e-2 if dtype == np.float64 else 1):
        raise ValueError(
            f"angle reaches {largest:.4g} rad, where {dtype} resolves {rounding:.2g} rad, but "
            f"the shaft turns by {step:.2g} rad from sample to sample. Subtract the angle of the "
            f"first sample before it is rounded, or pass velocity."
        )


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
    rates = {name: rate for name, (_, rate) in series.items()}
    lasting = {name: len(values) / rate for name, (values, rate) in series.items()}
    if not all(map(np.isfinite, lasting.values())):
        raise ValueError(f"rates = {rates} make recordings of infinite length; they are in Hz.")
    longest = max(lasting, key=lambda name: lasting[name])
    for name, duration in lasting.items():
        allowed = max(1 / rates[name], 1 / rates[longest]) * (1 + 1e-9)
        if lasting[longest] - duration > allowed:
            raise ValueError(
                f"durations must agree within one sample, but {name} lasts {duration:.9g} s and "
                f"{longest} {lasting[longest]:.9g} s. Check fs and shaft_fs, or cut the longer one."
            )


def immutable(array: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return an array whose content cannot be changed through Python.

    Arrays over `bytes` and over memory maps that were opened read-only are kept as they are;
    all others are copied, as a read-only array may be made writeable again by its owner.
    """
    owner: Any = array
    while isinstance(owner, np.ndarray) and not owner.flags.writeable:
        owner = owner.base
    if isinstance(owner, bytes) or is_mapped(array):
        return array
    return np.frombuffer(array.tobytes(), array.dtype).reshape(array.shape)


def check_indices(
    signals: Any, shaft: Any, rates: Mapping[str, float], shaft_fs: float, reference: str
) -> None:
    """Check that the indices of pandas objects agree with the rates and with one another.

    Parameters
    ----------
    signals : mapping of str to array-like, or DataFrame
        The channels as given; those without an index are not checked.
    shaft : array-like
        The shaft reference as given.
    rates : mapping of str to float
        Sampling rates of the channels [Hz].
    shaft_fs : float
        Sampling rate of the shaft reference [Hz].
    reference : {"angle", "velocity"}
        Its name.

    Raises
    ------
    ValueError
        If times of an index have gaps or contradict the rate, if channels and shaft do not start
        at the same time, or if equally sampled ones have different indices.
    """
    series = {f"channel {name!r}": (signals[name], rates[name]) for name in signals}
    series[reference] = shaft, shaft_fs
    indexed = [(n, values.index, fs) for n, (values, fs) in series.items() if _has_index(values)]
    checked: set[tuple[int, float]] = set()
    for name, index, rate in indexed:
        if (id(index), rate) not in checked:
            checked.add((id(index), rate))
            _check_times(index, rate, name)
            _check_same_time(name, index, rate, indexed[0])


def _has_index(values: Any) -> bool:
    """Tell whether these are samples with an index that is more than their numbers from 0."""
    if not isinstance(values, pd.Series):
        return False
    index = values.index
    return not (isinstance(index, pd.RangeIndex) and index.start == 0 and index.step == 1)


def _is_time(index: pd.Index) -> bool:
    return isinstance(index, pd.DatetimeIndex | pd.TimedeltaIndex)


def _check_times(index: pd.Index, rate: float, name: str, *, tolerance: float = 0.6) -> None:
    """Refuse times that deviate from the rate by more than a part of a sampling interval."""
    if not _is_time(index) or len(index) < 2:
        return
    if index.hasnans:
        raise ValueError(f"the index of {name} has missing times (NaT). Repair it, or drop it.")
    seconds = (index - index[0]).to_numpy() / np.timedelta64(1, "s")
    steps = np.diff(seconds)
    resolution = float(steps[steps > 0].min()) if (steps > 0).any() else 0.0
    if (steps > 0).all() or resolution < 1 / rate:
        resolution = 0.0  # otherwise several samples have one time: it is coarser than the rate
    off = np.abs(seconds - np.arange(len(index)) / rate) > tolerance / rate + resolution
    if off.any():
        place = int(np.argmax(off))
        mean = (len(index) - 1) / seconds[-1] if seconds[-1] else np.inf
        raise ValueError(
            f"the index of {name} contradicts fs = {rate:g} Hz: sample {place} is at "
            f"{seconds[place]:.6g} s, expected was {place / rate:.6g} s (mean rate of the index: "
            f"{mean:.6g} Hz). Correct fs, or resample to uniform times and fill the gaps."
        )


def _check_same_time(
    name: str, index: pd.Index, rate: float, first: tuple[str, pd.Index, float]
) -> None:
    other, other_index, other_rate = first
    if _is_time(index) and type(index) is type(other_index):
        # Not by total_seconds, which some versions of pandas round to microseconds.
        apart = abs((index[0] - other_index[0]) / pd.Timedelta(1, "s"))
        differ = apart > max(1 / rate, 1 / other_rate) * (1 + 1e-9)
        places = f"{name} starts at {index[0]}, {other} at {other_index[0]}"
    else:
        differ = rate == other_rate and len(index) == len(other_index)
        differ = differ and not index.equals(other_index)
        places = f"{name} starts with {index[0]!r}, {other} with {other_index[0]!r}"
    if differ:
        raise ValueError(
            f"{name} and {other} have different indices: {places}. Channels and shaft must start "
            f"at the same time. Align them by their index, or pass .to_numpy() if they are aligned."
        )
