"""A fitted model applied to signals while they are measured."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from emacm._checks import check_choice, check_number, check_real_array
from emacm._version import __version__
from emacm.alarms.control_charts import CUSUM, EWMA
from emacm.recordings.arguments import check_durations, check_rates, check_shaft_rate
from emacm.recordings.names import check_channel_names, chosen_channels
from emacm.resampling.order_resampler import check_angle_step
from emacm.streams.intervals import IntervalCutter, Samples
from emacm.streams.packed_state import Resumable, packed, unpacked
from emacm.streams.spectrum_stream import Settings, SpectrumStream
from emacm.streams.streamed_models import Reading, ReadingAlarms, StreamedModel

_ON = (
    "Nothing of this block was taken: repair the samples and push them again, or flush() and go on "
    "after them."
)


class StreamInput(Resumable):
    """Checks blocks of samples, and unwraps wrapped angles.

    Parameters
    ----------
    channels : sequence of str
        Names of the channels.
    groups : mapping of float to sequence of int
        Sampling rates [Hz], each with the channels that have it.
    shaft_fs : float
        That of the shaft reference [Hz].
    max_speed : float
        Highest speed of the shaft [rad/s].
    wrapped : bool
        Whether angles are wrapped at 2π.
    """

    held = ("_measured", "_last", "_turns")

    def __init__(
        self,
        channels: Sequence[str],
        groups: Mapping[float, Sequence[int]],
        shaft_fs: float,
        max_speed: float,
        wrapped: bool,
    ) -> None:
        self._channels, self._groups, self._shaft_fs = channels, groups, shaft_fs
        self._max_speed, self._wrapped = max_speed, wrapped
        self._labels = [f"channel {name!r}" for name in channels]
        self.reset()

    def reset(self) -> None:
        """Begin another recording."""
        self._measured = np.empty(0)  # the last angle
        self._last = np.empty(0)  # the same, unwrapped
        self._turns = 0  # between the two
        self._next = self._measured, self._last, self._turns

    def checked(
        self, signals: Any, shaft: Any, reference: str, times: Sequence[float]
    ) -> list[list[Samples]]:
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
        list of list of ndarray of shape (n_times,)
        """
        rows = self._rows(signals)
        streams = []
        for (rate, group), time in zip(self._groups.items(), times, strict=False):
            taken = [_samples(rows[k], self._labels[k], rate, time) for k in group]
            lengths = [len(row) for row in taken]
            if min(lengths) < max(lengths):
                k = int(np.not_equal(lengths, lengths[0]).argmax())
                raise ValueError(
                    f"channels of {rate:g} Hz must have equally many samples in a block, got "
                    f"{lengths[0]} and {lengths[k]} of {self._channels[group[k]]!r}."
                )
            streams.append(taken)
        motion = _samples(shaft, reference, self._shaft_fs, times[-1])
        if reference == "angle":
            motion = self._unwrapped(motion)
        self._check_speed(motion, reference, times[-1])
        return [*streams, [motion]]

    def accept(self) -> None:
        """Go on after the samples that were checked last."""
        self._measured, self._last, self._turns = self._next

    def _rows(self, signals: Any) -> Sequence[Any]:
        if isinstance(signals, Mapping):
            check_channel_names(list(signals), self._channels, "the block")
            return [signals[name] for name in self._channels]
        rows = list(signals) if np.iterable(signals) else []
        if len(rows) != len(self._channels):
            raise ValueError(
                f"signals must map channels to samples, or have a row for each of the channels "
                f"{list(self._channels)}, got {len(rows)} rows."
            )
        return rows

    def _check_speed(self, shaft: Samples, reference: str, time: float) -> None:
        speed = shaft
        if reference == "angle":
            speed = np.diff(np.concatenate([self._last, shaft])) * self._shaft_fs
        if not len(speed) or max(speed.max(), -speed.min()) <= self._max_speed:
            return
        speed = np.abs(speed)
        place = int(np.argmax(speed > self._max_speed))
        raise ValueError(
            f"the shaft turns at {speed[place]:.6g} rad/s at "
            f"{time + (place + len(shaft) - len(speed)) / self._shaft_fs:.6f} s, above max_speed = "
            f"{self._max_speed:g} rad/s. {_ON} Raise max_speed if the speed is real; an angle that "
            f"is wrapped at 2 pi needs wrapped=True."
        )

    def _unwrapped(self, measured: Samples) -> Samples:
        """Return angles that go on from the last one, as `numpy.unwrap` does for all at once."""
        angle, turns = measured, self._turns
        if self._wrapped and len(measured):
            angle = np.unwrap(np.concatenate([self._measured, measured]))[-len(measured) :]
            angle = angle + 2 * np.pi * turns
            turns = round((angle[-1] - measured[-1]) / (2 * np.pi))
        last = np.concatenate([self._last, angle])[-1:]
        self._next = np.concatenate([self._measured, measured])[-1:], last, turns
        return angle


def _samples(values: Any, name: str, fs: float, time: float) -> Samples:
    """Return finite samples, none or more, of a block that begins at `time`."""
    samples = check_real_array(values, name).astype(np.float64, copy=False)
    if samples.ndim != 1:
        raise ValueError(f"{name} must be one-dimensional, got shape {samples.shape}.")
    if not np.isfinite(samples).all():
        place = int(np.isfinite(samples).argmin())
        raise ValueError(
            f"{name} is {samples[place]} at {time + place / fs:.6f} s, sample {place} of the "
            f"block. {_ON}"
        )
    return samples


UNITS = ("revolutions", "s")


class OrderMonitor:
    """Apply a fitted model to signals while they are measured.

    Samples are accepted in blocks of any length. The features of a reading are those that the model
    computes of a `Recording` of the same samples, whatever the blocks are. Only what later results
    depend on is held: some 21,000 samples of each channel, and a few segments.

    Parameters
    ----------
    model : estimator
        Fitted pipeline of `OrderResampler`, `OrderPSD`, transformers of tables (`BinTransformer`,
        `FaultLines`, scaling, ...) and a classifier. Steps that need a whole recording (envelopes,
        prewhitening, baselines, statistics of strokes, unions of features, routers) are refused.
    fs : float or mapping of str to float
        Sampling rate [Hz], one for all channels or one for each.
    channels : sequence of str
        Names of the channels, among them those of the model.
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
    alarms : mapping of str to EWMA or CUSUM, optional
        Fitted charts of single features (names as of ``model[:-1].get_feature_names_out()``) or of
        "expected_cost". Unknown states, untypical readings, intervals without a segment, and
        levels and units far outside those of the training are alarms in any case (`InputAlarm`).

    Attributes
    ----------
    time : float
        Time up to which all channels and the shaft were received [s].

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or the model needs whole recordings; the message names the step
        or option.

    Notes
    -----
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
        alarms: Mapping[str, EWMA | CUSUM] | None = None,
    ) -> None:
        self._model = StreamedModel(model)
        self._channels = chosen_channels(channels, ())
        check_channel_names(self._channels, self._model.resampler.channels_, "the stream")
        self._rates = check_rates(fs, self._channels)
        self._shaft_fs = check_shaft_rate(shaft_fs, self._rates)
        self._max_speed = check_number(max_speed, "max_speed", above=0, at_most=1e6, unit="rad/s")
        self._every = None if every is None else check_number(every, "every", above=0)
        self._unit = check_choice(unit, "unit", UNITS)
        self._groups = {  # channels of one rate are held together
            rate: [k for k, name in enumerate(self._channels) if self._rates[name] == rate]
            for rate in self._rates.values()
        }
        self._all_rates = [*self._groups, self._shaft_fs]
        self._input = StreamInput(
            self._channels,
            self._groups,
            self._shaft_fs,
            self._max_speed,
            check_choice(wrapped, "wrapped", (True, False)),
        )
        self._alarms = ReadingAlarms(self._model, alarms)
        self._origin = 0.0  # time of the first sample of the recording
        self._reference: str | None = None

    @property
    def time(self) -> float:
        """Time up to which all channels and the shaft were received [s]."""
        return self._origin + self._duration()

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
        reference = "velocity" if angle is None else "angle"
        self._check_reference(reference, velocity, angle)
        origin = self._checked_time(time)
        begun = self._reference is not None
        streams = self._input.checked(
            signals,
            velocity if angle is None else angle,
            reference,
            [origin + n / r for n, r in zip(self._received(), self._all_rates, strict=True)],
        )
        if begun:
            self._check_memory()
        if not begun:
            self._origin, self._reference = origin, reference
            self._begin()
        self._input.accept()
        self._cutter.append(streams)
        return self._advance()

    def flush(self) -> list[Reading]:
        """End the recording; the next samples begin another one.

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
        if self._reference is None:
            return []
        groups = [[f"channel {self._channels[k]!r}" for k in g] for g in self._groups.values()]
        counts = zip([*groups, ["the shaft"]], self._received(), self._all_rates, strict=True)
        check_durations({name: (range(n), r) for names, n, r in counts for name in names})  # type: ignore[misc]
        self._feed(self._cutter.take(all_of_them=True))
        end = self.time
        readings = [self._finish(end)] if end > self._origin + self._cutter.start else []
        self.reset()
        self._origin = end
        return readings

    def reset(self) -> None:
        """Forget the samples since the start or the last reading, after an error."""
        end = self.time
        self._reference = None
        self._input.reset()
        self._origin = end

    def state(self) -> bytes:
        """Return all that another monitor of this model needs to go on after the last sample.

        Returns
        -------
        bytes
            An npz file of arrays and numbers, without pickled code.
        """
        state: dict[str, Any] = {
            "settings": self._settings_text(),
            "model": self._model.digest(),
            "origin": self._origin,
            "alarms": self._alarms.state(),
            "input": self._input.state(),
        }
        if self._reference is not None:
            state |= {"reference": self._reference, "cutter": self._cutter.state()}
            state["stream"] = self._stream.state()
        return packed(state)

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
            If the state cannot be read, or is that of another model or other options. Of a state
            that is damaged inside, nothing is restored: the monitor then has no samples.
        """
        tree = unpacked(state)
        stated, own = tree.get("settings"), self._settings_text()
        if stated != own:
            raise ValueError(
                f"the state belongs to a monitor of other settings: {stated}; this one has {own}. "
                f"Use the same model and options."
            )
        if tree.get("model") != self._model.digest():
            raise ValueError(
                "the state belongs to another model: its parameters or fitted values differ. Load "
                "the model with which the state was written, or begin another recording without it."
            )
        try:
            self._restore(tree)
        except (KeyError, IndexError, TypeError, ValueError) as error:
            self._reference, self._origin = None, 0.0
            self._input.reset()
            text = "nothing was restored. Go on without it, which begins another recording."
            raise ValueError(f"the state is damaged ({error!r}); {text}") from error
        return self

    def _restore(self, tree: dict[str, Any]) -> None:
        self._origin = tree["origin"]
        self._input.restore(tree["input"])
        self._alarms.restore(tree["alarms"])
        self._reference = tree.get("reference")
        if self._reference is not None:
            self._begin()
            self._cutter.restore(tree["cutter"])
            self._stream.restore(tree["stream"])

    def _received(self) -> list[int]:
        if self._reference is None:
            return [0] * len(self._all_rates)
        return self._cutter.received

    def _duration(self) -> float:
        return min(n / r for n, r in zip(self._received(), self._all_rates, strict=True))

    def _begin(self) -> None:
        """Begin a recording."""
        resampler, names = self._model.resampler, self._model.resampler.channels_
        self._settings = self._stream_settings()
        self._wanted = []  # of each group of the model: group of the stream, and rows in it
        for rate, channels in self._settings.groups:
            places = [self._groups[rate].index(self._channels.index(names[k])) for k in channels]
            self._wanted.append((list(self._groups).index(rate), places))
        turn = 2 * np.pi / float(resampler.ratio)
        in_seconds = self._unit == "s" and self._every is not None
        rest = self._reference or "velocity", float(resampler.min_speed)
        sizes = [*map(len, self._groups.values()), 1]
        interval = self._every, in_seconds, turn
        self._cutter = IntervalCutter(self._all_rates, sizes, *interval, *rest)
        self._stream = SpectrumStream(self._settings)

    def _advance(self) -> list[Reading]:
        """Process the samples that are known to belong to an interval."""
        readings: list[Reading] = []
        while True:
            self._feed(self._cutter.take())
            if not self._cutter.complete:
                return readings
            readings.append(self._finish(self._origin + (self._cutter.stop or 0.0)))
            self._cutter.next()
            self._stream = SpectrumStream(self._settings)

    def _feed(self, streams: list[list[Samples]]) -> None:
        wanted = [[streams[g][k] for k in rows] for g, rows in self._wanted]
        self._stream.append(wanted, streams[-1][0])

    def _finish(self, end: float) -> Reading:
        """Return the reading of the interval that ends now."""
        start, error = self._origin + self._cutter.start, ""
        reading, severe = Reading(start, end, None, {}, None, {}, None), []
        try:
            reading = self._model.reading(start, end, self._stream.finish())
            statements = self._model.outside_training(self._stream.quality)
            outside = tuple(s.text for s in statements) or reading.alarms  # new lines
            reading = replace(reading, outside_training=outside)
            severe = [statement.text for statement in statements if statement.severe]
        except ValueError as problem:  # such as an interval in which the shaft stands still
            error = " ".join(str(problem).split())
        return replace(reading, alarms=self._alarms.update(reading, error, severe))

    def _check_memory(self) -> None:
        n_held = max(self._stream.n_held, self._cutter.n_waiting)
        if n_held > self._settings.most_held:
            raise ValueError(
                f"at {self.time:.6g} s, {n_held} samples of a channel are held, as the last stroke "
                f"may go on after a rest, or as a channel or the shaft lags behind. Call reset(), "
                f"and set max_rest or min_speed of OrderResampler (model.set_params)."
            )

    def _check_reference(self, reference: str, velocity: Any, angle: Any) -> None:
        if (velocity is None) == (angle is None):
            raise ValueError("exactly one of velocity and angle must be given.")
        if self._reference not in (None, reference):
            raise ValueError(
                f"the stream began with {self._reference}, got {reference}. Give the same one, or "
                f"end the recording by flush()."
            )

    def _checked_time(self, time: float | None) -> float:
        """Return the time of the first sample of the recording [s]."""
        if time is None:
            return self._origin
        start = check_number(time, "time", unit="s")
        if self._reference is None:
            return start
        if abs(start - self.time) > 1 / min(self._all_rates):
            raise ValueError(
                f"the stream goes on at {self.time:.9g} s, and these samples begin at "
                f"{start:.9g} s. Call flush() for the reading up to the gap (or overlap); the next "
                f"push then begins another recording."
            )
        return self._origin

    def _stream_settings(self) -> Settings:
        resampler = self._model.resampler
        rates = [self._rates[name] for name in resampler.channels_]
        groups = {r: tuple(i for i, rate in enumerate(rates) if rate == r) for r in rates}
        return Settings(
            self._reference or "velocity",
            self._shaft_fs,
            tuple(groups.items()),
            check_angle_step(resampler.theta_s),
            resampler.direction,
            float(resampler.min_speed),
            resampler.max_rest,
            float(resampler.ratio),
            self._max_speed,
            self._model.psd.plan,
        )

    def _settings_text(self) -> str:
        """Return what must agree, beside the model, for a state to be restored."""
        facts = {
            "version": __version__,
            "channels": self._channels,
            "fs": self._rates,
            "shaft_fs": self._shaft_fs,
            "max_speed": self._max_speed,
            "every": self._every,
            "unit": self._unit,
            "alarms": self._alarms.charts,
        }
        return json.dumps(facts)
