"""A fitted model applied to signals while they are measured."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import clone

from emacm._checks import check_choice, check_number, check_signal
from emacm._saved import Resumable, packed, unpacked
from emacm._version import __version__
from emacm.recordings.arguments import check_durations, check_rates, check_shaft_rate
from emacm.recordings.names import check_channel_names, chosen_channels
from emacm.streams.shaft_stream import Samples
from emacm.streams.spectrum_stream import IntervalCutter, Settings, SpectrumStream
from emacm.streams.streamed_models import Reading, ReadingAlarms, StreamedModel

_ON = (
    "Nothing of this block, and of short ones collected with it, was taken: repair the samples and "
    "push them again, or flush() and go on after them."
)


class StreamInput(Resumable):
    """Collects short blocks of samples, checks them together, and unwraps wrapped angles.

    Parameters
    ----------
    channels, names : sequence of str
        Names of the channels of the stream, and of those that are needed.
    settings : Settings
        Rates and channels (of `names`), and highest speed of the shaft.
    wrapped : bool
        Whether angles are wrapped at 2π.

    Attributes
    ----------
    n_collected : int
        Samples of the shaft that were collected, and not checked yet.
    """

    held = ("_last", "_turns", "_collected", "n_collected")

    def __init__(
        self, channels: Sequence[str], names: Sequence[str], settings: Settings, wrapped: bool
    ) -> None:
        self._channels, self._names = channels, names
        self._settings, self._wrapped = settings, wrapped
        one_rate = len({*settings.rates}) == 1  # of the channels and the shaft
        self._n_short = int(0.05 * settings.shaft_fs) if one_rate else 0  # as OrderMonitor states
        self.reset()

    def reset(self) -> None:
        """Begin another recording."""
        self._last: Samples = np.empty(0)  # the last angle, as measured
        self._turns = 0  # to be added to it
        self._collected: list[Samples] = []
        self.n_collected = 0

    def collect(self, signals: Any, shaft: Any) -> bool:
        """Keep a copy of a short block of arrays of equal lengths; tell whether it was kept."""
        if type(shaft) is not np.ndarray or shaft.size + self.n_collected >= self._n_short:
            return False
        rows = signals
        if isinstance(signals, Mapping):
            rows = [signals.get(name) for name in self._channels]
        if len(rows) != len(self._channels) or any(
            type(row) is not np.ndarray or row.shape != shaft.shape or row.dtype.kind not in "iuf"
            for row in (*rows, shaft)
        ):
            return False
        self._collected.append(np.array([*rows, shaft], np.float64))
        self.n_collected += shaft.size
        return True

    def collected(self) -> Samples:
        """Return what was collected, the shaft as the last row, and begin to collect again."""
        block = np.concatenate(self._collected, axis=1)
        self._collected, self.n_collected = [], 0
        return block

    def checked(
        self, signals: Any, shaft: Any, reference: str, times: Sequence[float]
    ) -> list[Samples]:
        """Return the samples of the channels of each group, and of the shaft, as arrays.

        Parameters
        ----------
        signals, shaft : array-like
            As for `OrderMonitor.push`.
        reference : {"velocity", "angle"}
            What `shaft` is.
        times : sequence of float
            Time of the first sample of each group and of the shaft [s].

        Returns
        -------
        list of ndarray of shape (n_rows, n_times)
        """
        rows = self._rows(signals)
        streams = []
        for (rate, group), time in zip(self._settings.groups.items(), times, strict=False):
            names = [self._names[k] for k in group]
            taken = [_samples(rows[name], f"channel {name!r}", time) for name in names]
            lengths = {name: len(row) for name, row in zip(names, taken, strict=True)}
            if len({*lengths.values()}) > 1:
                raise ValueError(
                    f"channels of {rate:g} Hz must have equally many samples, got {lengths}."
                )
            streams.append(np.array(taken))
        motion = _samples(shaft, reference, times[-1])
        if reference == "velocity":
            self._check_speed(motion, times[-1])
        elif len(motion):
            motion = self._continued(motion, times[-1])
        return [*streams, np.array([motion])]

    def _rows(self, signals: Any) -> Mapping[str, Any]:
        if isinstance(signals, Mapping):
            check_channel_names(list(signals), self._channels, "the block")
            return signals
        rows = list(signals) if np.iterable(signals) else []
        if len(rows) != len(self._channels):
            raise ValueError(
                f"signals must map channels to samples, or have a row for each of the channels "
                f"{list(self._channels)}, got {len(rows)} rows."
            )
        return dict(zip(self._channels, rows, strict=True))

    def _check_speed(self, speed: Samples, time: float) -> None:
        limit = self._settings.max_speed
        if not len(speed) or max(speed.max(), -speed.min()) <= limit:
            return
        speed = np.abs(speed)
        place = int(np.argmax(speed > limit))
        time += place / self._settings.shaft_fs
        rpm = 30 / np.pi
        raise ValueError(
            f"the shaft turns at {speed[place]:.6g} rad/s at {time:.6f} s, above max_speed = "
            f"{limit:g} rad/s ({rpm * speed[place]:.4g} and {rpm * limit:.4g} rpm). {_ON} Raise "
            f"max_speed if the speed is real; an angle that is wrapped at 2 pi needs wrapped=True."
        )

    def _continued(self, measured: Samples, time: float) -> Samples:
        """Return angles that go on from the last one; wrapped ones as `numpy.unwrap` does."""
        steps = np.diff(measured, prepend=self._last if len(self._last) else measured[:1])
        added = np.zeros(len(steps))
        if self._wrapped:
            added = np.rint(steps / (-2 * np.pi))
        self._check_speed((steps + 2 * np.pi * added) * self._settings.shaft_fs, time)
        turns = self._turns + np.cumsum(added)
        self._last, self._turns = measured[-1:].copy(), int(turns[-1])
        return measured + 2 * np.pi * turns


def _samples(values: Any, name: str, time: float) -> Samples:
    """Return finite samples, none or more, of a block that begins at `time`."""
    try:
        return check_signal(values, name, min_length=0).astype(np.float64, copy=False)
    except ValueError as error:
        raise ValueError(f"block at {time:.6f} s: {error} {_ON}") from error


UNITS = ("revolutions", "s")
_PARTS = ("input", "alarms", "cutter", "stream")


class OrderMonitor:
    """Apply a fitted model to signals while they are measured.

    Samples are accepted in blocks of any length. Blocks of arrays of one rate that are shorter than
    50 ms are collected until they are as long, and then checked and processed together. The
    features of a reading are those that the model computes of a `Recording` of the same samples,
    whatever the blocks are. Only what later results depend on is held: some 25,000 samples of each
    channel, and a few segments.

    Parameters
    ----------
    model : estimator
        Fitted pipeline of `OrderResampler`, `OrderPSD`, transformers of tables (`BinTransformer`,
        `FaultLines`, scaling, ...) and a classifier. Steps that need a whole recording (envelopes,
        prewhitening, baselines, statistics of strokes, unions of features, routers) are refused.
    fs : float or mapping of str to float
        Sampling rate [Hz], one for all channels or one for each.
    channels : sequence of str
        Names of the channels, among them those of the model; samples of the others are not used.
    max_speed : float
        Highest speed of the measured shaft [rad/s]. How densely signals are upsampled depends on
        the highest speed of a stroke, which is not known before its end; all densities up to that
        for `max_speed` are computed. Choose it close to the highest speed that occurs.
    shaft_fs : float, optional
        Sampling rate of the shaft reference [Hz]. Default: that of the channels.
    every : float, optional
        Length of the interval of a reading. Default: one reading, at `flush`, of all samples.
    unit : {"revolutions", "s"}
        Unit of `every`: revolutions of the shaft of interest, or seconds.
    wrapped : bool
        Whether `angle` is wrapped at 2π. Its steps must then be less than π.

    Attributes
    ----------
    time : float
        Time up to which all channels of the model and the shaft were received [s].

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or the model needs whole recordings; the message names the step
        or option.

    See Also
    --------
    emacm.score : Decisions on recordings.
    emacm.monitoring.EWMA : Alarms on its readings.

    Notes
    -----
    Alarms of a reading are an unknown state, two successive readings with a typicality of at most
    0.01, an interval without a segment, levels and units far outside those of the training, new
    spectral lines, and channels that are clipped, overflow, drop out or have a far offset, unlike
    in training. Control charts are updated with its features or its expected cost.

    A stroke goes on after a rest if the shaft then turns in the same direction. The samples of a
    rest are therefore held until it ends. `max_rest` of `OrderResampler` ends a stroke after a
    stated time at rest and limits the memory; without it, more than some four million samples of a
    channel are refused. The shaft may turn back by 0.25 rad along a stroke (jitter).

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn.pipeline import make_pipeline
    >>> from emacm import BinTransformer, CostSensitiveGaussianBayes, OrderMonitor, OrderPSD
    >>> from emacm import OrderResampler, Recording
    >>> rng = np.random.default_rng(0)
    >>> speed = np.full(8000, 90.0)
    >>> X = [Recording({"force": (1 + k % 2) * rng.normal(size=8000)}, 2000, velocity=speed)
    ...      for k in range(20)]
    >>> model = make_pipeline(OrderResampler(), OrderPSD(4), BinTransformer(max_order=2),
    ...                       CostSensitiveGaussianBayes()).fit(X, ["new", "worn"] * 10)
    >>> monitor = OrderMonitor(model, fs=2000, channels=["force"], max_speed=100, every=20)
    >>> readings = []
    >>> for block in np.split(X[1].signals["force"], 80):
    ...     readings += monitor.push({"force": block}, velocity=speed[:100])
    >>> [(reading.time, reading.decision) for reading in readings]
    [(1.397, 'worn'), (2.7935, 'worn')]
    """

    def __init__(
        self,
        model: Any,
        *,
        fs: float | Mapping[str, float],
        channels: Sequence[str],
        max_speed: float,
        shaft_fs: float | None = None,
        every: float | None = None,
        unit: str = "revolutions",
        wrapped: bool = False,
    ) -> None:
        self._model = StreamedModel(model)
        self._channels = chosen_channels(channels, ())
        self._names = self._model.resampler.channels_
        check_channel_names(self._channels, self._names, "the stream")
        self._rates = check_rates(fs, self._channels)
        self._shaft_fs = check_shaft_rate(shaft_fs, self._rates)
        self._max_speed = check_number(max_speed, "max_speed", above=0, at_most=1e6, unit="rad/s")
        self._every = np.inf if every is None else check_number(every, "every", above=0)
        self._unit = check_choice(unit, "unit", UNITS)
        rates = [self._rates[name] for name in self._names]
        self._groups = {  # channels of one rate are held together
            rate: [k for k, other in enumerate(rates) if other == rate] for rate in rates
        }
        unknown = getattr(self._model.classifier, "unknown", None)
        self._alarms = ReadingAlarms("unknown" if unknown is None else unknown)
        self._begin("", 0.0)
        wrapped = check_choice(wrapped, "wrapped", (True, False))
        self._input = StreamInput(self._channels, self._names, self._settings, wrapped)

    @property
    def time(self) -> float:
        """Time up to which all channels of the model and the shaft were received [s]."""
        return min(self._times(self._origin)) + self._input.n_collected / self._shaft_fs

    def push(
        self,
        signals: Mapping[str, ArrayLike] | ArrayLike,
        *,
        velocity: ArrayLike | None = None,
        angle: ArrayLike | None = None,
        time: float | None = None,
    ) -> list[Reading]:
        """Add the next samples, and return the readings that are complete with them.

        Parameters
        ----------
        signals : mapping of str to array-like, or array-like of shape (n_channels, n_times)
            The next samples of each channel; rows in the order of `channels`. There may be none.
        velocity : array-like of shape (n_shaft_times,)
            The next samples of the shaft velocity [rad/s], signed.
        angle : array-like of shape (n_shaft_times,)
            Or of the shaft angle [rad]; the same one of the two in every call.
        time : float, optional
            Time of the first of these samples [s]; a gap to the samples before is an error. The
            first call sets the time of the stream, which otherwise begins at 0.

        Returns
        -------
        list of Reading
            In order of time.

        Raises
        ------
        TypeError, ValueError
            If samples are invalid: not finite, faster than `max_speed`, or after a gap. The message
            states their time and how to continue; nothing of the block was taken.
        """
        if (velocity is None) == (angle is None):
            raise ValueError("exactly one of velocity and angle must be given.")
        reference, shaft = ("velocity", velocity) if angle is None else ("angle", angle)
        if self._reference not in ("", reference):
            raise ValueError(
                f"the stream began with {self._reference}, got {reference}. Keep it, or flush()."
            )
        if time is None and self._reference and self._input.collect(signals, shaft):
            return []
        self._take_collected()
        origin = self._checked_time(time)
        self._take(signals, shaft, reference, origin)
        return self._advance()

    def flush(self, *, complete: bool | None = None) -> list[Reading]:
        """End the recording; the next samples begin another one.

        Parameters
        ----------
        complete : bool, optional
            Whether the reading is one of all samples that were wanted. Default: if `every` is None;
            otherwise, the interval is unfinished.

        Returns
        -------
        list of Reading
            The reading of all samples since the start, or since the last interval; none if no
            sample was received.

        Raises
        ------
        ValueError
            If the durations of channels and shaft differ by more than a sample.
        """
        if not self._reference:
            return []
        self._take_collected()
        readings = self._advance()
        labels = [f"channel {self._names[group[0]]!r}" for group in self._groups.values()]
        received = zip(self._cutter.rows, self._settings.rates, strict=True)
        counts: Any = [(range(rows.length), rate) for rows, rate in received]
        check_durations(dict(zip([*labels, "the shaft"], counts, strict=True)))
        self._stream.append(self._cutter.take(all_of_them=True))
        end = self.time
        if end > self._origin + self._cutter.start:
            is_whole = self._every == np.inf if complete is None else complete
            readings.append(self._finish(end, complete=is_whole))
        self.reset()
        return readings

    def reset(self) -> None:
        """Forget the samples since the start or the last reading, after an error."""
        time = self.time
        self._input.reset()
        self._begin("", time)

    def state(self) -> bytes:
        """Return all that another monitor of this model needs to go on after the last sample.

        Returns
        -------
        bytes
            An npz file of arrays and numbers, without pickled code.
        """
        parts = {name: getattr(self, f"_{name}") for name in _PARTS}
        own = {"settings": self._settings_text(), "origin": self._origin}
        return packed(own | parts | {"reference": self._reference})

    def restore(self, state: bytes) -> OrderMonitor:
        """Go on after the last sample before `state`.

        Parameters
        ----------
        state : bytes
            What `state` returned.

        Returns
        -------
        OrderMonitor
            Itself; `time` is the time of the next sample.

        Raises
        ------
        ValueError
            If the state cannot be read, or is that of another model or other options.
        """
        tree = unpacked(state)
        stated, own = tree.get("settings"), self._settings_text()
        if stated != own:
            raise ValueError(
                f"the state belongs to another model, or to other options: {stated}; this monitor "
                f"has {own}. Take the model and options it was written with, or begin anew."
            )
        self._begin(tree["reference"], tree["origin"])
        for name in _PARTS:
            getattr(self, f"_{name}").restore(tree[name])
        return self

    def _times(self, origin: float) -> list[float]:
        """Return the time of the next sample of each group and of the shaft [s]."""
        received = zip(self._cutter.rows, self._settings.rates, strict=True)
        return [origin + rows.length / rate for rows, rate in received]

    def _begin(self, reference: str, origin: float) -> None:
        """Begin a recording, whose shaft reference is "" before its first samples."""
        self._reference, self._origin = reference, origin
        self._settings = Settings(
            reference,
            self._shaft_fs,
            self._groups,
            self._names,
            clone(self._model.resampler),  # what is set meanwhile counts for the next recording
            self._max_speed,
            self._model.psd.plan_,
        )
        slowest = min(*self._rates.values(), self._shaft_fs)
        self._cutter = IntervalCutter(self._settings, slowest, self._every, self._unit == "s")
        self._stream = SpectrumStream(self._settings)

    def _take(self, signals: Any, shaft: Any, reference: str, origin: float) -> None:
        """Check a block, and add it to the samples of the recording, which may begin with it."""
        self._check_memory()
        streams = self._input.checked(signals, shaft, reference, self._times(origin))
        if not self._reference:
            self._begin(reference, origin)
        self._cutter.append(streams)

    def _take_collected(self) -> None:
        """Take the short blocks that were collected."""
        if self._input.n_collected:
            *signals, shaft = self._input.collected()
            self._take(signals, shaft, self._reference, self._origin)

    def _advance(self) -> list[Reading]:
        """Process the samples that are known to belong to an interval."""
        readings: list[Reading] = []
        while True:
            self._stream.append(self._cutter.take())
            if not self._cutter.complete:
                return readings
            readings.append(self._finish(self._origin + self._cutter.stop))
            self._cutter.next()
            self._stream = SpectrumStream(self._settings)

    def _finish(self, end: float, *, complete: bool = True) -> Reading:
        """Return the reading of the interval that ends now."""
        start = self._origin + self._cutter.start
        try:
            powers = self._stream.finish()
            quality = self._stream.quality.quality({n: self._rates[n] for n in self._names})
            reading = self._model.reading(start, end, powers, quality, complete=complete)
        except ValueError as problem:  # such as an interval in which the shaft stands still
            error = " ".join(str(problem).split())
            reading = Reading(start, end, complete=complete, error=error)
        return replace(reading, alarms=self._alarms.update(reading)) if complete else reading

    def _check_memory(self) -> None:
        n_held = max(rows.n_held for rows in [*self._stream.inputs, *self._cutter.rows])
        if n_held > self._settings.most_held:
            raise ValueError(
                f"at {self.time:.6g} s, {n_held} samples of a channel are held, as the last stroke "
                f"may go on after a rest, or as a channel or the shaft lags behind. Call reset(), "
                f"and set max_rest or min_speed of OrderResampler (model.set_params)."
            )

    def _checked_time(self, time: float | None) -> float:
        """Return the time of the first sample of the recording [s]."""
        if time is None:
            return self._origin
        start = check_number(time, "time", unit="s")
        if not self._reference:
            return start
        if abs(start - self.time) > 1 / min(self._settings.rates):
            raise ValueError(
                f"the stream goes on at {self.time:.9g} s, but the block begins at {start:.9g} s. "
                f"Call flush() for the reading up to the gap (or overlap), and push them again."
            )
        return self._origin

    def _settings_text(self) -> str:
        """Return what must agree for a state to be restored."""
        facts = {
            "version": __version__,
            "model": self._model.digest(),
            "channels": self._channels,
            "fs": self._rates,
            "shaft_fs": self._shaft_fs,
            "max_speed": self._max_speed,
            "every": self._every,
            "unit": self._unit,
        }
        return json.dumps(facts)
