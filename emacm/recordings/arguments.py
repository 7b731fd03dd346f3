"""Checks of the arguments of `Recording`."""

from __future__ import annotations

import mmap
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._checks import check_number, check_signal, check_unique_columns
from emacm.shaft.angle import angle_from_wrapped, is_wrapped
from emacm.shaft.motion import Series

_FEW = 10  # samples; of a shorter angle, a single step may be most of the range
_INDEX_TOLERANCE = 0.6  # sampling intervals by which a time index may deviate from the rate


def check_signals(signals: Any) -> dict[str, NDArray[np.floating]]:
    """Return the channels by name as finite, immutable arrays."""
    if isinstance(signals, pd.DataFrame):
        check_unique_columns(signals, "signals")
        signals = {name: signals[name] for name in signals.columns}
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


def check_shaft(angle: Any, velocity: Any) -> tuple[str, NDArray[np.floating]]:
    """Return which shaft reference was given, "angle" or "velocity", and its samples."""
    if (angle is None) == (velocity is None):
        came = "neither" if angle is None else "both"
        raise ValueError(
            f"exactly one of angle and velocity must be given, got {came}. The functions of "
            f"emacm.shaft compute one from a tachometer, a resolver, a position or currents."
        )
    if angle is None:
        return "velocity", immutable(check_signal(velocity, "velocity"))
    shaft = check_signal(angle, "angle")
    if is_wrapped(shaft):
        return "angle", angle_from_wrapped(shaft)
    steps = np.abs(np.diff(shaft))
    if len(shaft) >= _FEW and steps.max() > max(np.ptp(shaft) / 2, np.pi):
        raise ValueError(
            f"angle jumps by {steps.max():.4g} after sample {int(steps.argmax())}, which is most "
            f"of its whole range ({np.ptp(shaft):.4g}). Is it wrapped, in degrees, in counts or "
            f"with noise? Pass emacm.angle_from_wrapped(angle, period=...), in rad."
        )
    return "angle", immutable(shaft)


def check_shaft_rate(shaft_fs: Any, rates: dict[str, float]) -> float:
    """Return the sampling rate of the shaft reference [Hz]; by default, that of the channels."""
    if shaft_fs is not None:
        return check_number(shaft_fs, "shaft_fs", above=0, unit="Hz")
    if len(set(rates.values())) > 1:
        raise ValueError(
            f"shaft_fs must be given where the channels have different rates, got fs={rates}."
        )
    return next(iter(rates.values()))


def check_durations(series: Mapping[str, tuple[Series, float]]) -> None:
    """Raise a ValueError if durations differ by more than one sample.

    Parameters
    ----------
    series : mapping of str to (Series, float)
        Channels and the shaft reference under what to call them, each with its rate [Hz].
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
    """Return an array whose content nobody can change through Python.

    Arrays over `bytes` and over memory maps that were opened read-only are kept as they are;
    all others are copied, as a read-only array may be made writeable again by its owner.
    """
    owner: Any = array
    while isinstance(owner, np.ndarray):
        if owner.flags.writeable:
            break
        owner = owner.base
    buffer = getattr(owner, "obj", owner) if isinstance(owner, memoryview) else owner
    if isinstance(buffer, bytes):
        return array
    if isinstance(buffer, mmap.mmap) and memoryview(buffer).readonly:
        return array
    return np.frombuffer(array.tobytes(), array.dtype).reshape(array.shape)
