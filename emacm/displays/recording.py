"""A recording as it was measured: signals and shaft speed over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.displays import _drawing, _tables
from emacm.displays._drawing import Display
from emacm.recordings.recording import Recording
from emacm.shaft.motion import find_strokes

# Direction of a stroke: label, grey and hatch of its background.
_STROKES = {1: ("forward stroke", "0.93", ""), -1: ("reverse stroke", "0.85", "....")}

Line = tuple[NDArray[np.floating], NDArray[np.floating]]  # times and values, equally long


@dataclass(eq=False, repr=False)
class RecordingDisplay(Display):
    """Signals of one recording and its shaft speed over time, one panel for each.

    Parameters
    ----------
    times : mapping of str to array-like of shape (n_times,)
        Time of each sample [s], by channel.
    signals : mapping of str to array-like of shape (n_times,)
        The channels, by name.
    shaft_times : array-like of shape (n_shaft_times,)
        Time of each sample of the shaft speed [s].
    speed : array-like of shape (n_shaft_times,)
        Shaft speed [rad/s], signed.
    units : mapping of str to str, optional
        Unit of each channel.
    envelopes : mapping of str to {"amplitude", "squared"}, optional
        Channels that are envelopes, see `EnvelopeDetector`. `units` holds the unit of the measured
        channel.
    strokes : sequence of (start, stop, direction)
        Strokes to be shaded: times [s], and 1 (forward) or -1 (reverse).

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (n_channels + 1,)
        Set when the display is drawn; the last is that of the shaft speed.
    figure_ : Figure
        Figure of these Axes.

    Raises
    ------
    TypeError, ValueError
        If a channel has no times or another length, a value is not finite, or an option is
        invalid.

    Examples
    --------
    >>> display = RecordingDisplay({"current": [0, 1]}, {"current": [5.0, 6.0]}, [0, 1], [1.0, 1.0])
    >>> display.frame().loc["current", "value"].tolist()
    [5.0, 6.0]
    """

    times: Any
    signals: Any
    shaft_times: Any
    speed: Any
    units: Any = field(default=None, kw_only=True)
    envelopes: Any = field(default=None, kw_only=True)
    strokes: Sequence[tuple[float, float, int]] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        if list(self.times) != list(self.signals) or not self.signals:
            raise ValueError(
                f"times and signals must name the same channels, and at least one; got "
                f"{list(self.times)} and {list(self.signals)}."
            )
        check, self.times, self.signals = _tables.check_values, dict(self.times), dict(self.signals)
        for name in self.signals:
            self.signals[name] = check(self.signals[name], f"channel {name!r}", (None,))
            shape = self.signals[name].shape
            self.times[name] = check(self.times[name], f"times of channel {name!r}", shape)
        self.speed = check(self.speed, "speed", (None,))
        self.shaft_times = check(self.shaft_times, "shaft_times", self.speed.shape)
        self.units, self.envelopes = self.units or {}, self.envelopes or {}

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
        chosen = _tables.chosen_channels(recording, channels)
        part = recording.select(chosen)
        start = 0.0
        if between is not None:
            slowest = min(*part.fs.values(), part.shaft_fs)
            start = np.ceil(between[0] * slowest - 1e-6) / slowest  # as in `Recording.cut`
            part = part.cut(*between)
        fs, speed = part.shaft_fs, part.velocity
        found = find_strokes(speed, min_speed=min_speed) if shade_strokes else []
        display = cls(
            {name: start + np.arange(len(part.signals[name])) / part.fs[name] for name in part.fs},
            dict(part.signals),
            start + np.arange(len(speed)) / fs,
            speed,
            units=part.units if units is None else units,
            envelopes=_tables.envelopes_in(part),
            strokes=[(start + s.start / fs, start + (s.stop - 1) / fs, s.direction) for s in found],
        )
        return display.plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return a column ``value``, indexed by channel (or "shaft speed") and time [s]."""
        series = [(name, self.times[name], values) for name, values in self.signals.items()]
        series.append(("shaft speed", self.shaft_times, self.speed))
        tables = [
            pd.DataFrame({"value": values}, index=pd.Index(times, name="time"))
            for _, times, values in series
        ]
        return pd.concat(tables, keys=[name for name, _, _ in series], names=["quantity"])

    def _draw(self, ax: Any) -> Any:
        axes = _drawing.panel_axes(ax, len(self.signals) + 1, height=1.3)
        for panel, (name, values) in zip(axes[:-1], self.signals.items(), strict=True):
            self._draw_line(panel, self.times[name], values)
            _drawing.label_y(panel, *_tables.quantity_of("", name, self.units, self.envelopes))
        self._draw_line(axes[-1], self.shaft_times, self.speed)
        axes[-1].axhline(0, color="0.4", linewidth=0.6)
        _drawing.label_y(axes[-1], "shaft speed", "rad/s")
        last = max(float(times[-1]) for times in (self.shaft_times, *self.times.values()))
        for panel in axes:
            panel.set_xlim(self.shaft_times[0], last)
        _drawing.label_x(axes, "time [s]")
        _drawing.legend_above(axes[0])
        return axes

    def _draw_line(
        self, panel: Any, times: NDArray[np.floating], values: NDArray[np.floating]
    ) -> None:
        for start, stop, direction in self.strokes:
            label, grey, hatch = _STROKES[direction]
            named = label in panel.get_legend_handles_labels()[1]
            style = {"facecolor": grey, "edgecolor": "0.7", "hatch": hatch, "linewidth": 0}
            panel.axvspan(start, stop, zorder=0, label=None if named else label, **style)
        panel.plot(*extremes(times, values), color=_drawing.PLAIN, linewidth=0.8)


def extremes(times: NDArray[np.floating], values: NDArray[np.floating], most: int = 20_000) -> Line:
    """Return the lowest and the highest sample of each short interval, at most `most` samples."""
    if len(values) <= most:
        return times, values
    length = -(-2 * len(values) // most)
    whole = len(values) // length * length
    blocks = values[:whole].reshape(-1, length)
    starts = np.arange(0, whole, length)
    places = np.sort([starts + blocks.argmin(axis=1), starts + blocks.argmax(axis=1)], axis=0)
    kept = np.concatenate([places.T.reshape(-1), np.arange(whole, len(values))])
    return times[kept], values[kept]
