"""One measured run of one machine: channels over time and the motion of its shaft."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_number, check_signal, check_unique_columns
from emacm.recordings.digests import Stamps, content_digest, file_stamps
from emacm.shaft.angle import angle_from_velocity, angle_from_wrapped, is_wrapped
from emacm.shaft.motion import DifferentiatedVelocity, IntegratedAngle, Series

_FEW = 10  # samples of an angle in which a single step may be most of the way
_CONTENT = ("_fs", "_meta", "_shaft", "_signals", "reference", "shaft_fs")
_DIGESTS = "1"  # goes up when digests are made otherwise, as pickles carry them
_MOST_VERIFIED = 100_000
# Contents of files that this process has read, so that a worker reads no file a second time when
# the next task brings the same recordings.
_verified: set[tuple[Stamps, str]] = set()


class Recording:
    """One measured run: channels over time and the shaft's angle or velocity.

    All channels and the shaft reference start at one instant; each may have a
    rate of its own. A recording is immutable: writeable arrays are copied, and
    read-only ones (a file opened by ``np.load(..., mmap_mode="r")``, say) are
    kept as they are, so that a recording larger than memory can be made.

    Parameters
    ----------
    signals : mapping of str to array-like of shape (n_times,), or DataFrame
        The channels by name, in any unit. float32 stays float32; all other
        numbers become float64.
    fs : float or mapping of str to float
        Sampling rate [Hz], one for all channels or one for each.
    angle : array-like of shape (n_shaft_times,), optional
        Shaft angle [rad], cumulative, or wrapped at 2π. It is taken as wrapped
        only if its values span at most 2π and some step exceeds π.
    velocity : array-like of shape (n_shaft_times,), optional
        Shaft velocity [rad/s], signed. Exactly one of `angle` and `velocity`
        must be given; the functions of `emacm.shaft`
        make one from a resolver, a position, phase currents or tacho pulses.
    shaft_fs : float, optional
        Sampling rate of the shaft reference [Hz]. Default: that of the channels.
    meta : mapping, optional
        Whatever else is known: unit, condition, load, run.

    Attributes
    ----------
    channels : tuple of str
        Names of the channels, in the order given.
    signals : mapping of str to ndarray of shape (n_times,)
        The channels; read-only.
    fs : mapping of str to float
        Sampling rate of each channel [Hz].
    shaft_fs : float
        Sampling rate of the shaft reference [Hz].
    reference : {"angle", "velocity"}
        Which of the two was given.
    meta : mapping
        What was given as `meta`; read-only.

    Raises
    ------
    TypeError
        If a channel is text, complex or otherwise not numeric.
    ValueError
        If a value is not finite (the message names channel and sample), if
        durations differ by more than one sample, if a rate is not positive, or
        if the shaft reference is missing or given twice.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(2000) / 1000
    >>> run = Recording(
    ...     {"current": np.sin(6 * 10 * t)}, 1000, velocity=np.full(2000, 10.0), meta={"unit": "A"}
    ... )
    >>> run
    Recording(current 1000 Hz; velocity 1000 Hz; 2 s, 3.18 revolutions; unit='A')
    >>> float(round(run.angle[-1], 3))
    19.99
    """

    __slots__ = (*_CONTENT, "_remembered")

    _signals: Mapping[str, NDArray[np.floating]]
    _fs: dict[str, float]
    _shaft: NDArray[np.floating]
    _meta: dict[Any, Any]
    reference: str
    shaft_fs: float
    # What was once worked out, each with the state of the files that it was worked out from.
    _remembered: dict[str, tuple[Stamps, Any]]

    def __init__(
        self,
        signals: Mapping[str, ArrayLike] | pd.DataFrame,
        fs: float | Mapping[str, float],
        *,
        angle: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        shaft_fs: float | None = None,
        meta: Mapping[Any, Any] | None = None,
    ) -> None:
        channels = _check_signals(signals)
        rates = _check_rates(fs, tuple(channels))
        reference, shaft = _check_shaft(angle, velocity)
        if meta is not None and not isinstance(meta, Mapping):
            raise TypeError(f"meta must be a mapping such as {{'unit': 'A'}}, got {meta!r}.")
        state = {
            "_signals": channels,
            "_fs": rates,
            "_shaft": shaft,
            "_meta": copy.deepcopy(dict(meta or {})),
            "reference": reference,
            "shaft_fs": _check_shaft_rate(shaft_fs, rates),
        }
        self.__setstate__(state)
        _check_durations(self)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels, in the order given."""
        return tuple(self._signals)

    @property
    def signals(self) -> Mapping[str, NDArray[np.floating]]:
        """The channels by name; read-only."""
        return MappingProxyType(self._signals)

    @property
    def series(self) -> Mapping[str, Series]:
        """The channels by name, to be read slice by slice; of measured ones, `signals`."""
        return self.signals

    @property
    def fs(self) -> Mapping[str, float]:
        """Sampling rate of each channel [Hz]."""
        return MappingProxyType(self._fs)

    @property
    def meta(self) -> Mapping[Any, Any]:
        """What else is known of the run; read-only."""
        return MappingProxyType(self._meta)

    @property
    def angle(self) -> NDArray[np.floating]:
        """Cumulative shaft angle [rad] at `shaft_fs`, integrated where velocity was given."""
        if self.reference == "angle":
            return self._shaft
        return angle_from_velocity(self._shaft, self.shaft_fs)

    @property
    def velocity(self) -> NDArray[np.floating]:
        """Shaft velocity [rad/s] at `shaft_fs`, differentiated where angle was given."""
        if self.reference == "velocity":
            return self._shaft
        return np.gradient(self._shaft) * self.shaft_fs

    @property
    def motion(self) -> tuple[Series, Series]:
        """Angle [rad] and velocity [rad/s] at `shaft_fs`, computed slice by slice when read."""
        if self.reference == "angle":
            return self._shaft, DifferentiatedVelocity(self._shaft, self.shaft_fs)
        return IntegratedAngle(self._shaft, self.shaft_fs), self._shaft

    @property
    def velocity_range(self) -> tuple[float, float]:
        """Lowest and highest `velocity` [rad/s]; looked up once."""
        return self._once("velocity_range", self._velocity_range)

    @property
    def digest(self) -> str:
        """SHA-256 of channels, rates and shaft, without `meta`; worked out once.

        Signals in a file are read again after the file was written.
        """
        return self._once("digest", self._digest)

    @property
    def duration(self) -> float:
        """Time that every channel and the shaft reference cover [s]."""
        return min(length for _, length, _ in _durations(self))

    def __repr__(self) -> str:
        """Channels, rates, length, revolutions and meta on one line."""
        channels = ", ".join(f"{name} {rate:g} Hz" for name, rate in self._fs.items())
        turned = float(np.abs(np.diff(self.angle)).sum()) / (2 * np.pi)
        parts = [
            channels,
            f"{self.reference} {self.shaft_fs:g} Hz",
            f"{self.duration:.3g} s, {turned:.3g} revolutions",
            ", ".join(f"{key}={value!r}" for key, value in self._meta.items()),
        ]
        return f"Recording({'; '.join(filter(None, parts))})"

    def __eq__(self, other: object) -> bool:
        """Two recordings are equal if channels, rates, shaft and meta are."""
        if not isinstance(other, Recording):
            return NotImplemented
        return all(_same(getattr(self, name), getattr(other, name)) for name in _CONTENT)

    def __hash__(self) -> int:
        """Agree for equal recordings, without reading the signals."""
        lengths = tuple(map(len, self.series.values()))
        return hash((self.channels, tuple(self._fs.values()), lengths, len(self._shaft)))

    def __copy__(self) -> Recording:
        """Return itself: nothing in it can change."""
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Recording:
        """Return itself: nothing in it can change."""
        return self

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse: a recording is immutable."""
        raise AttributeError(
            f"a Recording cannot be changed (tried to set {name!r}); make a new one instead."
        )

    def __delattr__(self, name: str) -> None:
        """Refuse: a recording is immutable."""
        raise AttributeError(f"a Recording cannot be changed (tried to delete {name!r}).")

    def __getstate__(self) -> dict[str, Any]:
        """Return all that pickle and joblib's hash need.

        The digest is always worked out, so that workers need not do so with each task, and
        equal recordings look alike to joblib, whatever was asked of them before.
        """
        content = {name: getattr(self, name) for name in _CONTENT}
        return content | {"_digest": (_DIGESTS, self.digest)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take over checked content and write-protect it."""
        # joblib hands large arrays to its workers as memory maps; a recording is the same there.
        signals = {name: np.asarray(signal) for name, signal in state["_signals"].items()}
        state = state | {"_shaft": np.asarray(state["_shaft"]), "_signals": signals}
        for array in (state["_shaft"], *signals.values()):
            array.flags.writeable = False
        for name in _CONTENT:
            object.__setattr__(self, name, state[name])
        object.__setattr__(self, "_remembered", {})
        self._take_digest(*state.get("_digest", ("", "")))

    def _take_digest(self, made_by: str, digest: str) -> None:
        """Believe a digest that came along, unless a file may have changed on the way."""
        stamps = file_stamps(self._arrays()) if made_by == _DIGESTS else None
        if stamps is None:
            return
        known = not stamps or (stamps, digest) in _verified
        self._remembered["digest" if known else "digest to verify"] = (stamps, digest)

    def _arrays(self) -> list[NDArray[np.floating]]:
        return [self._shaft, *self._signals.values()]

    def _once(self, name: str, work_out: Callable[[], Any]) -> Any:
        """Return what is remembered, or work it out, as long as no file is written."""
        stamps = file_stamps(self._arrays())
        known = self._remembered.get(name)
        if known is not None and stamps is not None and known[0] == stamps:
            return known[1]
        value = work_out()
        if stamps is not None and stamps == file_stamps(self._arrays()):
            self._remembered[name] = (stamps, value)
            self._verify(stamps, value)
        return value

    def _verify(self, stamps: Stamps, digest: Any) -> None:
        """Note that a digest that came along is true for the files as they are."""
        if self._remembered.get("digest to verify") == (stamps, digest):
            if len(_verified) >= _MOST_VERIFIED:
                _verified.clear()
            _verified.add((stamps, digest))

    def _digest(self) -> str:
        facts = (self.channels, tuple(self._fs.values()), self.shaft_fs, self.reference)
        return content_digest(repr(facts), self._arrays())

    def _velocity_range(self) -> tuple[float, float]:
        velocity = self.velocity
        return float(velocity.min()), float(velocity.max())


def _frozen(array: NDArray[np.floating], given: Any) -> NDArray[np.floating]:
    """Copy what its owner could still write to; a DataFrame's read-only views are such."""
    if isinstance(given, np.ndarray) and not np.may_share_memory(array, given):
        return array  # converted, so it is ours
    return array if _unchangeable(array) else array.copy()


def _unchangeable(array: Any) -> bool:
    """Tell whether neither the array nor what it is a view of can be written to."""
    while isinstance(array, np.ndarray):
        if array.flags.writeable:
            return False
        array = array.base
    return True


def _check_signals(signals: Any) -> dict[str, NDArray[np.floating]]:
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
        name: _frozen(check_signal(values, f"channel {name!r}"), values)
        for name, values in signals.items()
    }


def _check_rates(fs: Any, channels: tuple[str, ...]) -> dict[str, float]:
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


def _check_shaft(angle: Any, velocity: Any) -> tuple[str, NDArray[np.floating]]:
    if (angle is None) == (velocity is None):
        came = "neither" if angle is None else "both"
        raise ValueError(
            f"exactly one of angle and velocity must be given, got {came}. See emacm.shaft for "
            f"making one from a resolver, a position, currents or tacho pulses."
        )
    if angle is None:
        return "velocity", _frozen(check_signal(velocity, "velocity"), velocity)
    shaft = check_signal(angle, "angle")
    if is_wrapped(shaft):
        return "angle", angle_from_wrapped(shaft)
    steps = np.abs(np.diff(shaft))
    if len(shaft) >= _FEW and steps.max() > max(np.ptp(shaft) / 2, np.pi):
        raise ValueError(
            f"angle jumps by {steps.max():.4g} after sample {int(steps.argmax())}, which is most "
            f"of all that it spans ({np.ptp(shaft):.4g}). Is it wrapped, in degrees, in counts or "
            f"with noise? Pass emacm.angle_from_wrapped(angle, period=...), in rad."
        )
    return "angle", _frozen(shaft, angle)


def _check_shaft_rate(shaft_fs: Any, rates: dict[str, float]) -> float:
    if shaft_fs is not None:
        return check_number(shaft_fs, "shaft_fs", above=0, unit="Hz")
    if len(set(rates.values())) > 1:
        raise ValueError(
            f"shaft_fs must be given where the channels have different rates, got fs={rates}."
        )
    return next(iter(rates.values()))


def _durations(recording: Recording) -> Iterator[tuple[str, float, float]]:
    """Yield the name, duration [s] and sampling interval [s] of every series."""
    for name, signal in recording.series.items():
        rate = recording._fs[name]
        yield f"channel {name!r}", len(signal) / rate, 1 / rate
    shaft, rate = recording._shaft, recording.shaft_fs
    yield f"the shaft's {recording.reference}", len(shaft) / rate, 1 / rate


def _check_durations(recording: Recording) -> None:
    series = list(_durations(recording))
    if not all(np.isfinite(duration) for _, duration, _ in series):
        raise ValueError(f"fs = {recording._fs} makes recordings without end; rates are in Hz.")
    longest = max(series, key=lambda entry: entry[1])
    for name, duration, interval in series:
        allowed = max(interval, longest[2]) * (1 + 1e-9)
        if longest[1] - duration > allowed:
            raise ValueError(
                f"durations must agree within one sample, but {name} lasts {duration:.9g} s and "
                f"{longest[0]} {longest[1]:.9g} s. Check fs and shaft_fs, or cut the longer one."
            )


def _same(one: Any, other: Any) -> bool:
    """Compare values that may hold arrays."""
    if one is other:
        return True
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return list(one) == list(other) and all(_same(one[key], other[key]) for key in one)
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        equal_nan = one.dtype.kind in "fc"
        return one.dtype == other.dtype and np.array_equal(one, other, equal_nan=equal_nan)
    if type(one) is not type(other):
        return bool(np.isscalar(one) and np.isscalar(other) and one == other)
    if isinstance(one, pd.DataFrame | pd.Series | pd.Index):
        return bool(one.equals(other))
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    return bool(one == other or (one != one and other != other))
