"""One measured run of one machine: channels over time and the motion of its shaft."""

from __future__ import annotations

import copy
from collections import UserDict
from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import partial
from itertools import chain
from math import ceil
from types import MappingProxyType
from typing import Any

import joblib
import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm import _kernels
from emacm._checks import check_number
from emacm.recordings.arguments import (
    check_durations,
    check_indices,
    check_rates,
    check_shaft,
    check_shaft_rate,
    check_signals,
    check_units,
    immutable,
)
from emacm.recordings.digests import content_digest
from emacm.recordings.names import check_channel_names, chosen_channels
from emacm.shaft.angle import angle_from_velocity
from emacm.shaft.motion import (
    DifferentiatedVelocity,
    IntegratedAngle,
    Jump,
    LazySeries,
    Series,
    ShaftPath,
    Stroke,
    find_strokes,
    largest_jump,
    longest_gap,
    paths_along,
    sources,
)

CONTENT = ("_fs", "_meta", "_series", "_shaft", "_units", "reference", "shaft_fs")


class Recording:
    """One measured run: channels over time and the shaft's angle or velocity.

    All channels and the shaft reference start at one instant; each may have its
    own sampling rate. A recording is immutable: arrays are copied, except those that are
    read-only (after ``x.setflags(write=False)``, which must stay so), and read-only memory maps
    (``np.load(file, mmap_mode="r")``), so that a recording can be larger than memory.

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
    velocity : float or array-like of shape (n_shaft_times,), optional
        Shaft velocity [rad/s], signed; a number is a constant velocity. Exactly one of `angle`
        and `velocity` must be given; the functions of `emacm.shaft` compute one from a
        tachometer, a resolver, a position or phase currents.
    shaft_fs : float, optional
        Sampling rate of the shaft reference [Hz]. Default: that of the channels.
    units : mapping of str to str, optional
        Unit of each channel, for the axes of figures: ``{"vibration": "g"}``. Nothing is converted.
    meta : mapping, optional
        Further properties of the run: unit, condition, load, run.

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
    units : mapping of str to str
        Units of those channels for which one was given; read-only.
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

    See Also
    --------
    emacm.open_recording : A recording from a file.
    emacm.RecordingFolder : All recordings of a folder, read when they are needed.
    emacm.angle_from_tacho : The shaft angle from a tachometer.

    Notes
    -----
    A file below a memory map must not be changed or truncated while the recording is in use:
    values that were read before may be kept, and reading beyond the end of a truncated file ends
    the process (SIGBUS), which Python cannot prevent.

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

    __slots__ = (*CONTENT, "_known")

    _series: dict[str, Series]
    _fs: dict[str, float]
    _shaft: NDArray[np.floating]
    _meta: dict[Any, Any]
    _units: dict[str, str]
    reference: str
    shaft_fs: float
    _known: dict[Hashable, Any]  # results that were computed from the content

    def __init__(
        self,
        signals: Mapping[str, ArrayLike] | pd.DataFrame,
        fs: float | Mapping[str, float],
        *,
        angle: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        shaft_fs: float | None = None,
        units: Mapping[str, str] | None = None,
        meta: Mapping[Any, Any] | None = None,
    ) -> None:
        channels = check_signals(signals)
        rates = check_rates(fs, tuple(channels))
        shaft_rate = check_shaft_rate(shaft_fs, rates)
        fastest = max(channels, key=lambda name: rates[name])
        n_times = max(2, round(len(channels[fastest]) / rates[fastest] * shaft_rate))
        reference, shaft = check_shaft(angle, velocity, n_times)
        if meta is not None and not isinstance(meta, Mapping):
            raise TypeError(f"meta must be a mapping such as {{'unit': 'A'}}, got {meta!r}.")
        given = {f"channel {name!r}": (signals[name], rates[name]) for name in channels}
        check_indices(given | {reference: (velocity if angle is None else angle, shaft_rate)})
        state: dict[str, Any] = {
            "_series": channels,
            "_fs": rates,
            "_shaft": shaft,
            "_meta": copy.deepcopy(dict(meta or {})),
            "_units": check_units(units, tuple(channels)),
            "reference": reference,
            "shaft_fs": shaft_rate,
        }
        self.__setstate__(state)
        check_durations(self._timed())

    def cut(self, start: float = 0.0, stop: float | None = None) -> Recording:
        """Return the part of the recording from one time to another.

        Parameters
        ----------
        start : float
            Start [s]. The part begins at the first sample of the slowest channel from there on;
            the other channels begin at their samples nearest to it.
        stop : float, optional
            End [s], exclusive. Default: the end of the recording.

        Returns
        -------
        Recording
            Its time starts at 0; a cumulative shaft angle keeps its values.

        Raises
        ------
        TypeError, ValueError
            If the times are not in order within the recording, or the part has fewer than two
            samples.
        """
        return self._derived(cut_content, start, stop)

    def select(self, channels: Sequence[str]) -> Recording:
        """Return the recording with some of its channels only, in the order given.

        Raises
        ------
        TypeError, ValueError
            If `channels` is not a list of channels of the recording, each named once.
        """
        return self._derived(selected_content, channels)

    def _derived(self, change: Callable[..., dict[str, Any]], *arguments: Any) -> Recording:
        """Return the recording with the changes of content that a function returns."""
        changed = Recording.__new__(Recording)
        changed.__setstate__(self.__getstate__() | change(self, *arguments))
        changed._known["identity"] = self.identity, change, joblib.hash(arguments)
        return changed

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels, in the order given."""
        return tuple(self._series)

    @property
    def signals(self) -> Mapping[str, NDArray[np.floating]]:
        """The channels by name, as read-only arrays; computed ones are computed when read."""
        return MappingProxyType(Arrays(self._series))

    @property
    def series(self) -> Mapping[str, Series]:
        """The channels by name, to be read slice by slice; of measured ones, `signals`."""
        return MappingProxyType(self._series)

    @property
    def fs(self) -> Mapping[str, float]:
        """Sampling rate of each channel [Hz]."""
        return MappingProxyType(self._fs)

    @property
    def units(self) -> Mapping[str, str]:
        """Units of the channels, where they were given."""
        return MappingProxyType(self._units)

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
        return np.asarray(self._speed)

    @property
    def motion(self) -> tuple[Series, Series]:
        """Angle [rad] and velocity [rad/s] at `shaft_fs`, computed slice by slice when read."""
        if self.reference == "angle":
            return self._shaft, self._speed
        integrated = partial(IntegratedAngle, self._shaft, self.shaft_fs)
        return self.once(("angle", _kernels.loops), integrated), self._speed

    @property
    def _speed(self) -> Series:
        """Shaft velocity [rad/s] at `shaft_fs`, to be read slice by slice."""
        if self.reference == "velocity":
            return self._shaft
        return DifferentiatedVelocity(self._shaft, self.shaft_fs)

    def strokes(self, min_speed: float = 0.0, max_rest: float | None = None) -> list[Stroke]:
        """Return the sections in which the shaft turns in one direction.

        Parameters
        ----------
        min_speed : float
            Speed up to which the shaft counts as standing still [rad/s].
        max_rest : float, optional
            Longest time at standstill that does not end a stroke [s]. Default: any.

        Returns
        -------
        list of Stroke
            As `emacm.shaft.motion.find_strokes` finds them; searched for once.

        Raises
        ------
        TypeError, ValueError
            If one of the two is not a number of at least 0.
        """
        min_speed = check_number(min_speed, "min_speed", at_least=0, unit="rad/s")
        max_gap = longest_gap(max_rest, self.shaft_fs)
        find = partial(find_strokes, self._speed, min_speed, max_gap)
        return self.once(("strokes", min_speed, max_gap), find)

    def once(self, name: Hashable, compute: Callable[[], Any]) -> Any:
        """Return a result of the content; computed when it is first needed."""
        if name not in self._known:
            self._known[name] = compute()
        return self._known[name]

    def fact(self, name: Hashable, compute: Callable[[], Any]) -> Any:
        """Return a small result of the content, which is kept as long as the recording."""
        return self.once(name, compute)

    @property
    def identity(self) -> Hashable:
        """A key of the content in this process: other recordings have others."""
        return self.once("identity", object)

    @property
    def jump(self) -> Jump | None:
        """Largest isolated jump of the shaft reference; None if there is none."""
        return self.once("jump", lambda: largest_jump(self._speed, self.shaft_fs))

    def paths(
        self, direction: str = "strokes", min_speed: float = 0.0, max_rest: float | None = None
    ) -> list[ShaftPath]:
        """Return the travel of the shaft along each of its strokes.

        Parameters
        ----------
        direction : {"strokes", "forward", "reverse", "travel"}
            As for `OrderResampler`.
        min_speed, max_rest : float
            As for `strokes`.

        Returns
        -------
        list of ShaftPath
            In order of time; made once.
        """
        strokes = self.strokes(min_speed, max_rest)
        along = self.motion[0], self.shaft_fs, strokes, direction, min_speed
        known = "paths", _kernels.loops, direction, min_speed, max_rest
        return self.once(known, partial(paths_along, *along))

    @property
    def digest(self) -> str:
        """SHA-256 of channels, rates and shaft, without `meta`; computed once."""
        return self.once("digest", lambda: content_digest(self._facts(), self._arrays()))

    def _facts(self) -> str:
        """Return what the digest depends on besides the arrays."""
        computed = {name: s for name, s in self._series.items() if isinstance(s, LazySeries)}
        facts = (self.channels, tuple(self._fs.values()), self.shaft_fs, self.reference)
        return repr((*facts, computed) if computed else facts)

    @property
    def duration(self) -> float:
        """Time that every channel and the shaft reference cover [s]."""
        return min(len(series) / rate for series, rate in self._timed().values())

    def __repr__(self) -> str:
        """Channels, rates, length, revolutions and meta on one line."""
        revolutions = np.abs(np.diff(self.angle)).sum() / (2 * np.pi)
        parts = [
            ", ".join(f"{name} {rate:g} Hz" for name, rate in self._fs.items()),
            f"{self.reference} {self.shaft_fs:g} Hz",
            f"{self.duration:.3g} s, {revolutions:.3g} revolutions",
            ", ".join(f"{key}={value!r}" for key, value in self._meta.items()),
        ]
        return f"Recording({'; '.join(filter(None, parts))})"

    def __eq__(self, other: object) -> bool:
        """Two recordings are equal if channels, rates, units, shaft and meta are."""
        if not isinstance(other, Recording):
            return NotImplemented
        own, its = ((r.digest, r._units, joblib.hash(r._meta)) for r in (self, other))
        return own == its

    def __hash__(self) -> int:
        """Agree for equal recordings, without reading the signals."""
        lengths = tuple(map(len, self.series.values()))
        return hash((self.channels, tuple(self._fs.values()), lengths, len(self._shaft)))

    def __deepcopy__(self, memo: Any = None) -> Recording:
        """Return itself: nothing in it can change."""
        return self

    __copy__ = __deepcopy__

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse: a recording is immutable."""
        raise AttributeError(
            f"a Recording cannot be changed (tried to set {name!r}); make a new one instead."
        )

    def __getstate__(self) -> dict[str, Any]:
        """Return the content, for pickle and joblib's hash; nothing that is remembered."""
        return {name: getattr(self, name) for name in CONTENT}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Set checked content, immutable."""
        # joblib passes large arrays to its workers as memory maps; the recording is the same.
        series = {
            name: s if isinstance(s, LazySeries) else immutable(np.asarray(s))
            for name, s in state["_series"].items()
        }
        changes = {"_shaft": immutable(np.asarray(state["_shaft"])), "_series": series}
        for name, value in (state | changes | {"_known": {}}).items():
            object.__setattr__(self, name, value)

    def _arrays(self) -> list[NDArray[np.floating]]:
        """Return all arrays that the content is computed from."""
        return [self._shaft, *chain(*map(sources, self._series.values()))]

    def _timed(self) -> dict[str, tuple[Series, float]]:
        """Return channels and shaft reference, as messages name them, with their rates [Hz]."""
        channels = {f"channel {n!r}": (s, self._fs[n]) for n, s in self._series.items()}
        return channels | {f"the shaft's {self.reference}": (self._shaft, self.shaft_fs)}


def cut_content(recording: Recording, start: Any, stop: Any) -> dict[str, Any]:
    """Return what changes in a recording that is cut, see `Recording.cut`."""
    duration = recording.duration
    begin = check_number(start, "start", at_least=0, unit="s")
    end = duration if stop is None else check_number(stop, "stop", above=0, unit="s")
    if not begin < end or end > duration * (1 + 1e-9):
        raise ValueError(
            f"start and stop must ascend within {duration:.9g} s, got {start!r} and {stop!r}."
        )
    slowest = min(*recording.fs.values(), recording.shaft_fs)
    # A time in seconds may miss a sample by rounding.
    begin = ceil(begin * slowest - 1e-6) / slowest
    parts = {}
    for name, (series, fs) in recording._timed().items():
        first, last = round(begin * fs), ceil(end * fs - 1e-6)
        if last - first < 2:
            raise ValueError(
                f"between {start!r} and {end:.9g} s there are {max(last - first, 0)} samples of "
                f"{name} ({fs:g} Hz); at least 2 are needed."
            )
        parts[name] = series[first:last]
    *channels, shaft = parts.values()
    return {"_series": dict(zip(recording.channels, channels, strict=True)), "_shaft": shaft}


def selected_content(recording: Recording, channels: Any) -> dict[str, Any]:
    """Return what changes in a recording of which channels are selected."""
    chosen = chosen_channels(channels, recording.channels)
    check_channel_names(recording.channels, chosen, "the recording")
    return {
        "_series": {name: recording.series[name] for name in chosen},
        "_fs": {name: recording.fs[name] for name in chosen},
        "_units": {name: recording.units[name] for name in chosen if name in recording.units},
    }


class Arrays(UserDict[str, Any]):
    """Channels as arrays, each computed as a whole when it is read."""

    def __getitem__(self, name: str) -> NDArray[np.floating]:
        series = self.data[name]
        return series if isinstance(series, np.ndarray) else immutable(series[:])


class ComputedSeries(LazySeries):
    """A signal computed from another one of the same length.

    Subclasses implement `read` and `__repr__` (class and parameters, of which digests are made).

    Parameters
    ----------
    signal : ndarray of shape (n_times,), or an object that can be sliced like one
        Finite; it may be a memory map.

    Attributes
    ----------
    bandwidth : float
        Frequency above which there is no content [Hz]; infinite if only the sampling rate limits
        it.
    """

    bandwidth = np.inf

    def __init__(self, signal: Series) -> None:
        super().__init__(len(signal), signal.dtype)
        self._signal = signal

    @property
    def sources(self) -> list[NDArray[Any]]:
        """The measured signal."""
        return sources(self._signal)

    def _described(self, *parameters: Any) -> str:
        """Return class and parameters, and those of the signal if it is computed as well."""
        inner = [self._signal] if isinstance(self._signal, ComputedSeries) else []
        return f"{type(self).__name__}({', '.join(map(repr, [*parameters, *inner]))})"

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the series, with the signal immutable."""
        vars(self).update(state)
        if isinstance(self._signal, np.ndarray):
            self._signal = immutable(self._signal)
