"""One recording: signals and shaft speed over time, and its order map over time or speed.

Spectra and maps over frequency in Hz are drawn beside those over orders: a resonance stays at its
own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
import scipy  # scipy.signal is imported when it is used
from numpy.typing import NDArray

from emacm._checks import check_choice
from emacm.displays import drawing, drawn_values
from emacm.displays.drawing import Display
from emacm.displays.drawn_values import OrderDisplay
from emacm.orders.segment_plan import SegmentPlan
from emacm.orders.welch import order_psd, samples_per_revolution
from emacm.recordings.names import unit_factor
from emacm.recordings.recording import Recording
from emacm.resampling.angle_recording import AngleStroke
from emacm.resampling.order_resampler import OrderResampler

# Direction of a stroke: label, grey and hatch of its background.
_STROKES = {1: ("forward stroke", "0.93", ""), -1: ("reverse stroke", "0.85", "....")}


@dataclass(eq=False, repr=False)
class RecordingDisplay(Display):
    """Signals of one recording and its shaft speed over time, one panel for each.

    Parameters
    ----------
    recording : Recording
        The channels to be drawn, and the shaft speed.
    start : float
        Time of the first sample [s].
    units : mapping of str to str, optional
        Unit of each channel. Default: those of the recording. Of an envelope, see
        `EnvelopeDetector`, this is the unit of the measured channel.
    strokes : sequence of (start, stop, direction)
        Strokes to be shaded: times [s], and 1 (forward) or -1 (reverse).

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (n_channels + 1,)
        Set when the display is drawn; the last is that of the shaft speed.
    figure_ : Figure
        Figure of these Axes.

    Examples
    --------
    >>> recording = Recording({"current": [5.0, 6.0]}, 10, velocity=[1.0, 1.0])
    >>> RecordingDisplay(recording).frame().loc["current", "value"].to_dict()
    {0.0: 5.0, 0.1: 6.0}
    """

    recording: Recording
    start: float = field(default=0.0, kw_only=True)
    units: Mapping[str, str] | None = field(default=None, kw_only=True)
    strokes: Sequence[tuple[float, float, int]] = field(default=(), kw_only=True)

    @classmethod
    def from_recording(
        cls,
        recording: Recording,
        *,
        channels: Sequence[str] | None = None,
        units: Mapping[str, str] | None = None,
        between: tuple[float, float] | None = None,
        shade_strokes: bool = False,
        min_speed: float = 0.0,
        ax: Any = None,
    ) -> RecordingDisplay:
        """Draw a recording.

        Parameters
        ----------
        recording : Recording
            One run.
        channels : sequence of str, optional
            Channels to draw, from top to bottom. Default: all.
        units : mapping of str to str, optional
            Unit of each channel. Default: those of the recording.
        between : tuple of two float, optional
            Start and end of the interval to draw [s]. Default: the whole recording.
        shade_strokes : bool
            Whether to shade the strokes, the sections of motion in one direction.
        min_speed : float
            Speed up to which the shaft is considered to be at standstill [rad/s], as for
            `OrderResampler`.
        ax : sequence of matplotlib Axes, optional
            Where to draw: one Axes for each channel, and one for the shaft speed.

        Returns
        -------
        RecordingDisplay

        Raises
        ------
        TypeError, ValueError
            If it is not a recording, has no such channel, or has no two samples in the interval.
        """
        chosen = drawn_values.chosen_channels(recording, channels)
        part = recording.select(chosen)
        start = 0.0
        if between is not None:
            slowest = min(*part.fs.values(), part.shaft_fs)
            start = np.ceil(between[0] * slowest - 1e-6) / slowest  # as in `Recording.cut`
            part = part.cut(*between)
        fs, found = part.shaft_fs, part.strokes(min_speed) if shade_strokes else []
        strokes = [(start + s.start / fs, start + (s.stop - 1) / fs, s.direction) for s in found]
        return cls(part, start=start, units=units, strokes=strokes).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return a column ``value``, indexed by channel (or "shaft speed") and time [s]."""
        part = self.recording
        rates = {**part.fs, "shaft speed": part.shaft_fs}
        lines = {}
        for name, values in {**part.signals, "shaft speed": part.velocity}.items():
            times = pd.Index(self.start + np.arange(len(values)) / rates[name], name="time")
            lines[name] = pd.DataFrame({"value": values}, times)
        return pd.concat(lines, names=["quantity"])

    def _draw(self, ax: Any) -> Any:
        lines = dict(iter(self.frame()["value"].groupby(level="quantity", sort=False)))
        axes = drawing.panel_axes(ax, len(lines), height=1.3)
        units = self.recording.units if self.units is None else self.units
        envelopes = drawn_values.envelopes_in(self.recording)
        for panel, (name, line) in zip(axes, lines.items(), strict=True):
            self._shade_strokes(panel)
            line = line.droplevel("quantity")
            panel.plot(line.index, line, color=drawing.PLAIN, linewidth=0.8)
            panel.set_xlim(self.start, max(own.index[-1][1] for own in lines.values()))
            drawing.label_y(panel, *drawn_values.quantity_of("", name, units, envelopes))
        axes[-1].axhline(0, color="0.4", linewidth=0.6)
        drawing.label_y(axes[-1], "shaft speed", "rad/s")
        drawing.label_x(axes, "time [s]")
        drawing.legend_above(axes[0])
        return axes

    def _shade_strokes(self, panel: Any) -> None:
        for start, stop, direction in self.strokes:
            label, grey, hatch = _STROKES[direction]
            named = label in panel.get_legend_handles_labels()[1]
            style = {"facecolor": grey, "edgecolor": "0.7", "hatch": hatch, "linewidth": 0}
            panel.axvspan(start, stop, zorder=0, label=None if named else label, **style)


@dataclass(eq=False, repr=False)
class OrderMapDisplay(OrderDisplay):
    """Order spectra of the segments of one recording, over time or over shaft speed.

    Parameters
    ----------
    orders : array-like of shape (n_orders,)
        Orders of the spectral lines, evenly spaced.
    psd : array-like of shape (n_segments, n_orders)
        Power spectral density of each segment [unit²/order].
    intervals : array-like of shape (n_segments, 2)
        Start and end of each segment [s], in order of time. Where segments overlap, each is
        drawn up to the middle of the overlap.
    speeds : array-like of shape (n_segments,)
        Mean shaft speed in each segment [rad/s], signed.
    over : {"time", "speed"}
        Quantity of the x axis, in s or rpm. Over speed, segments of nearly the same speed are
        averaged.
    n_speeds : int
        Number of speed classes, of equal width from the lowest to the highest speed.
    channel, unit : str
        Name and unit of the channel.
    envelope : {"amplitude", "squared"}, optional
        The channel is an envelope of this kind, and its unit is that of the measured channel.
    max_order : float, optional
        Highest order to draw.
    fault_orders : DataFrame of `emacm.fault_orders`, or mapping of str to float, optional
        Predicted fault orders, which are named. Those above `max_order` are not drawn.
    slip : float
        Largest relative slip: a line that slips may be lower or higher by this fraction of its
        order, and a bar beside the map marks this range. In a mapping every order may slip.

    Attributes
    ----------
    ax_, figure_
        Axes and figure, set when the display is drawn.
    colorbar_ : Colorbar
        The colour scale.

    Raises
    ------
    TypeError, ValueError
        If an option is invalid.

    Examples
    --------
    >>> import numpy as np
    >>> display = OrderMapDisplay(
    ...     np.arange(3), np.ones((2, 3)), [[0, 1], [1, 2]], [10.0, 20.0], over="speed"
    ... )
    >>> display.frame().index.get_level_values("speed").tolist()
    [10.0, 20.0]
    """

    orders: Any
    psd: Any
    intervals: Any
    speeds: Any
    over: str = field(default="time", kw_only=True)
    n_speeds: int = field(default=24, kw_only=True)
    channel: str = field(default="signal", kw_only=True)
    unit: str = field(default="unit", kw_only=True)
    envelope: str | None = field(default=None, kw_only=True)
    max_order: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.orders, self.psd = np.asarray(self.orders), np.asarray(self.psd, np.float64)
        self.intervals, self.speeds = np.asarray(self.intervals), np.asarray(self.speeds)
        check_choice(self.over, "over", ("time", "speed"))

    @classmethod
    def from_recording(
        cls,
        recording: Recording,
        channel: str | None = None,
        *,
        theta_s: float = 2 * np.pi / 128,
        revolutions: float = 4,
        max_order: float | None = None,
        ax: Any = None,
        **options: Any,
    ) -> OrderMapDisplay:
        """Resample a recording, estimate the spectrum of each segment, and draw them.

        Parameters
        ----------
        recording : Recording
            One run.
        channel : str, optional
            Channel to draw. Default: the first.
        theta_s
            As for `OrderResampler`.
        revolutions
            As for `OrderPSD`. Long segments resolve orders, short ones resolve time.
        max_order : float, optional
            Highest order to draw.
        ax : matplotlib Axes, optional
            Where to draw.
        **options
            As for the class: over, n_speeds, unit, fault_orders, slip.

        Returns
        -------
        OrderMapDisplay

        Raises
        ------
        TypeError, ValueError
            If an option is invalid, there is no such channel, or no stroke is as long as one
            segment.
        """
        chosen = drawn_values.chosen_channels(recording, channel and [channel])[0]
        resampler = OrderResampler(theta_s, channels=[chosen])
        strokes = resampler.fit_transform([recording])[0].strokes
        welch: dict[str, Any] = {"revolutions": revolutions, "max_order": max_order}
        plan = SegmentPlan(samples_per_revolution(theta_s), **welch)
        segments = [
            _segments(stroke, plan.step, plan.n_per_segment, welch)
            for stroke in strokes
            if stroke.n_angles >= plan.n_per_segment
        ]
        if not segments:
            longest = max((stroke.revolutions for stroke in strokes), default=0)
            raise ValueError(
                f"no stroke holds a segment of {plan.revolutions:g} revolutions; the longest has "
                f"{longest:.4g}. Lower revolutions."
            )
        parts = (np.concatenate(values) for values in zip(*segments, strict=True))
        options.setdefault("unit", recording.units.get(chosen, "unit"))
        options["envelope"] = drawn_values.envelopes_in(recording).get(chosen)
        display = cls(plan.orders, *parts, channel=chosen, max_order=max_order, **options)
        return display.plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the PSD: one row per segment (start, stop, speed), one column per order."""
        keys = [*self.intervals.T, self.speeds]
        index = pd.MultiIndex.from_arrays(keys, names=["start", "stop", "speed"])
        return pd.DataFrame(self.psd, index=index, columns=pd.Index(self.orders, name="order"))

    def _draw(self, ax: Any) -> Any:
        (ax,) = drawing.panel_axes(ax, height=3.8)
        edges, psd = self._over_time() if self.over == "time" else self._over_speed()
        top = self.orders[-1] if self.max_order is None else self.max_order
        if self.over == "speed":
            edges = edges / unit_factor("rpm", "velocity")
        # Detrending changes the line at order 0, which is not the order of any fault.
        drawn = (self.orders > 0) & (self.orders <= top)
        half = (self.orders[1] - self.orders[0]) / 2
        heights = np.append(self.orders[drawn] - half, self.orders[drawn][-1] + half)
        power = np.ma.masked_invalid(drawing.decibels(psd[:, drawn]).T)
        # Two fifths of the cells, mostly noise, are below the lowest colour.
        faintest = np.percentile(power.compressed(), 40) if power.count() else None
        style = {"vmin": faintest, "cmap": "magma", "rasterized": True}
        mesh = ax.pcolormesh(edges, heights, power, **style)
        ax.patch.set(facecolor="white", edgecolor=drawing.MISSING, hatch="////")
        name = "time [s]" if self.over == "time" else "shaft speed [rpm]"
        ax.set(xlabel=name, ylabel=drawing.ORDER_LABEL, ylim=(heights[0], top))
        drawing.mark_orders_beside(ax, self.fault_orders)
        self.colorbar_ = ax.figure.colorbar(mesh, ax=ax, extend="min")
        envelopes = {self.channel: self.envelope} if self.envelope else {}
        words, unit = drawn_values.quantity_of("PSD", self.channel, self.unit, envelopes)
        self.colorbar_.set_label(f"{words} [dB re 1 {drawing.squared(unit)}/order]")
        return ax

    def _over_time(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return edges over time and the spectra between them; NaN where there is no segment."""
        starts, stops = self.intervals.T
        following = np.append(starts[1:], stops[-1])
        ends = np.where(following <= stops, (following + stops) / 2, stops)
        gaps = np.flatnonzero(following > stops) + 1
        edges = np.insert(np.append(starts[0], ends), gaps + 1, following[gaps - 1])
        return edges, np.insert(self.psd, gaps, np.nan, axis=0)

    def _over_speed(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return edges over speed and the mean spectra between them; NaN without a segment."""
        low, high = self.speeds.min(), self.speeds.max()
        if np.isclose(low, high):
            low, high = low - 0.5, high + 0.5
        edges = np.linspace(low, high, self.n_speeds + 1)
        kind = np.clip(np.digitize(self.speeds, edges) - 1, 0, self.n_speeds - 1)
        means = pd.DataFrame(self.psd).groupby(kind).mean()
        return edges, means.reindex(range(self.n_speeds)).to_numpy()


def _segments(
    stroke: AngleStroke, step: int, length: int, welch: dict[str, Any]
) -> tuple[NDArray[np.floating], ...]:
    """Return spectra, intervals [s] and mean speeds [rad/s] of the segments of a stroke."""
    signal, theta_s = stroke.signals[0], stroke.parent.theta_s
    segments = np.lib.stride_tricks.sliding_window_view(signal, length)[::step]
    _, psd = order_psd(segments, samples_per_revolution(theta_s), **welch)
    starts = step * np.arange(len(segments))
    travel = theta_s * np.stack([starts, starts + length - 1], axis=1)
    path = stroke.path
    angles = np.asarray(path.travel)
    intervals = path.start_time + np.interp(travel, angles, np.arange(len(angles))) / path.fs
    turned = np.diff(travel)[:, 0] * (stroke.direction or 1)
    return psd, intervals, turned / np.diff(intervals)[:, 0]


def draw_spectra_in_hertz(
    recordings: Mapping[str, Recording], channel: str, highest: float, ax: Any
) -> None:
    """Draw the power spectra of a channel, up to the frequency of the highest order."""
    several = len(recordings) > 1
    tops = []
    for number, recording in enumerate(recordings.values(), several):
        fs, signal = recording.fs[channel], recording.signals[channel]
        frequency, psd = scipy.signal.welch(signal, fs, nperseg=min(len(signal), int(2 * fs)))
        style = drawing.line_style(number) if several else {"color": drawing.PLAIN}
        ax.plot(frequency[1:], drawing.decibels(psd[1:]), linewidth=0.8, **style)
        tops.append(min(_frequency(recording, highest), frequency[-1]))
    ax.set_xlim(0, max(tops))
    unit = next(iter(recordings.values())).units.get(channel, "unit")
    drawing.label_axes(ax, "frequency [Hz]", f"PSD [dB re 1 {drawing.squared(unit)}/Hz]")


def draw_map_in_hertz(
    recording: Recording, display: OrderMapDisplay, highest: float, ax: Any
) -> None:
    """Draw an order map over frequency, in segments as long in time as its middle one."""
    channel, fs = display.channel, recording.fs[display.channel]
    length = int(np.median(np.diff(display.intervals, axis=1)) * fs)
    frequency, times, psd = scipy.signal.spectrogram(
        recording.signals[channel], fs, "hann", length, length // 2
    )
    inside = frequency <= _frequency(recording, highest)
    known = np.arange(len(recording.velocity)) / recording.shaft_fs
    speeds = np.interp(times, known, recording.velocity)
    intervals = times[:, np.newaxis] + length / fs * np.array([-0.5, 0.5])
    options: Any = {"over": display.over, "channel": channel, "unit": display.unit}
    lower = OrderMapDisplay(frequency[inside], psd[inside].T, intervals, speeds, **options)
    lower.plot(ax=ax)
    ax.set_ylabel("frequency [Hz]")
    lower.colorbar_.set_label(f"PSD of {channel} [dB re 1 {drawing.squared(display.unit)}/Hz]")


def _frequency(recording: Recording, order: float) -> float:
    """Return the frequency of an order at the highest speed [Hz]."""
    return float(order * np.abs(recording.velocity).max() / (2 * np.pi))
