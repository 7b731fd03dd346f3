"""Pictures of a recording as it was measured: signals and shaft speed over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_number
from emacm.displays._drawing import (
    COLOURS,
    legend_beside,
    name_panels_below,
    name_side,
    panel_axes,
)
from emacm.displays._tables import (
    check_values,
)
from emacm.recordings.inputs import check_channel_names
from emacm.recordings.recording import Recording
from emacm.shaft.strokes import find_strokes

# Direction of a stroke: grey and hatch behind it.
_STROKES = {1: ("forward stroke", "0.93", ""), -1: ("reverse stroke", "0.85", "....")}
_MOST_POINTS = 20_000  # of a line; of longer signals the extremes of short stretches are drawn


class RecordingDisplay:
    """Signals of one recording and its shaft speed over time, one panel for each.

    Parameters
    ----------
    times : mapping of str to array-like of shape (n_times,)
        Time of each sample [s], by channel.
    signals : mapping of str to array-like of shape (n_times,)
        The channels, by name.
    shaft_times : array-like of shape (n_shaft_times,)
        Time of each sample of the shaft's speed [s].
    speed : array-like of shape (n_shaft_times,)
        Shaft speed [rad/s], signed.
    units : mapping of str to str, optional
        Unit of each channel.
    strokes : sequence of (start, stop, direction)
        Strokes to be shaded: times [s], and 1 (forward) or -1 (reverse).

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (n_channels + 1,)
        What was drawn on, once `plot` has run; the last is the shaft's.
    figure_ : Figure
        The figure of `ax_`.

    Raises
    ------
    TypeError, ValueError
        If a channel lacks times or is not as long, or a number is not finite.

    Examples
    --------
    >>> display = RecordingDisplay({"current": [0, 1]}, {"current": [5.0, 6.0]}, [0, 1], [1.0, 1.0])
    >>> display.frame().loc["current", "value"].tolist()
    [5.0, 6.0]
    """

    ax_: Any
    figure_: Any

    def __init__(
        self,
        times: Mapping[str, ArrayLike],
        signals: Mapping[str, ArrayLike],
        shaft_times: ArrayLike,
        speed: ArrayLike,
        *,
        units: Mapping[str, str] | None = None,
        strokes: Sequence[tuple[float, float, int]] = (),
    ) -> None:
        if list(times) != list(signals) or not signals:
            raise ValueError(
                f"times and signals must name the same channels, and one at least; got "
                f"{list(times)} and {list(signals)}."
            )
        self.signals = {
            name: check_values(values, f"channel {name!r}", (None,))
            for name, values in signals.items()
        }
        self.times = {
            name: check_values(values, f"times of channel {name!r}", self.signals[name].shape)
            for name, values in times.items()
        }
        self.speed = check_values(speed, "speed", (None,))
        self.shaft_times = check_values(shaft_times, "shaft_times", self.speed.shape)
        self.units = _checked_units(units, list(signals))
        self.strokes = list(strokes)
        for stroke in self.strokes:
            if len(stroke) != 3 or stroke[2] not in _STROKES:
                raise ValueError(f"a stroke must be (start, stop, 1 or -1), got {stroke!r}.")

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
            Which channels, from top to bottom. Default: all.
        units : mapping of str to str, optional
            Unit of each channel.
        between : tuple of two float, optional
            Start and end [s] of what is drawn. Default: all.
        shade_strokes : bool
            Whether to shade the strokes: a stretch in which the shaft turns one way.
        min_speed : float
            Speed up to which the shaft counts as standing [rad/s], as for `OrderResampler`.
        ax : sequence of matplotlib Axes, optional
            Where to draw: one for each channel, and one for the shaft.

        Returns
        -------
        RecordingDisplay

        Raises
        ------
        TypeError, ValueError
            If it is no recording, has no such channel, or nothing lies in between.
        """
        if not isinstance(recording, Recording):
            raise TypeError(f"recording must be one Recording, got {type(recording).__name__}.")
        chosen = list(recording.channels if channels is None else channels)
        check_channel_names(recording.channels, chosen, "the recording")
        start, stop = _checked_window(between, recording.duration)
        cut = {
            name: _between(recording.signals[name], recording.fs[name], start, stop)
            for name in chosen
        }
        shaft_times, speed = _between(recording.velocity, recording.shaft_fs, start, stop)
        found = find_strokes(recording.velocity, min_speed=min_speed) if shade_strokes else []
        fs = recording.shaft_fs
        strokes = [
            (max(s.start / fs, start), min((s.stop - 1) / fs, stop), s.direction)
            for s in found
            if s.start / fs < stop and (s.stop - 1) / fs > start
        ]
        display = cls(
            {name: times for name, (times, _) in cut.items()},
            {name: signal for name, (_, signal) in cut.items()},
            shaft_times,
            speed,
            units=units,
            strokes=strokes,
        )
        return display.plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the numbers: a column ``value``, indexed by channel (or shaft speed) and time."""
        series = [(name, self.times[name], values) for name, values in self.signals.items()]
        series.append(("shaft speed", self.shaft_times, self.speed))
        tables = [
            pd.DataFrame({"value": values}, index=pd.Index(times, name="time"))
            for _, times, values in series
        ]
        return pd.concat(tables, keys=[name for name, _, _ in series], names=["quantity"])

    def plot(self, *, ax: Any = None) -> RecordingDisplay:
        """Draw one panel below the other. Of a long signal, the extremes are drawn.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, optional
            Where to draw: one for each channel, and one for the shaft. Default: a new figure.

        Returns
        -------
        RecordingDisplay
            Itself.
        """
        axes = panel_axes(ax, len(self.signals) + 1, height=1.3)
        for panel, (name, values) in zip(axes[:-1], self.signals.items(), strict=True):
            self._draw_line(panel, self.times[name], values)
            name_side(panel, name, self.units.get(name, "unit"))
        self._draw_line(axes[-1], self.shaft_times, self.speed)
        axes[-1].axhline(0, color="0.4", linewidth=0.6)
        name_side(axes[-1], "shaft speed", "rad/s")
        for panel in axes:
            panel.set_xlim(self.shaft_times[0], max(self.shaft_times[-1], self._last()))
        name_panels_below(axes, "time [s]")
        if self.strokes:
            legend_beside(axes[0])
        self.ax_, self.figure_ = axes, axes[0].figure
        return self

    def _last(self) -> float:
        return max(float(times[-1]) for times in self.times.values())

    def _draw_line(
        self, panel: Any, times: NDArray[np.floating], values: NDArray[np.floating]
    ) -> None:
        named = set()
        for start, stop, direction in self.strokes:
            label, grey, hatch = _STROKES[direction]
            style = {"facecolor": grey, "edgecolor": "0.7", "hatch": hatch, "linewidth": 0}
            panel.axvspan(start, stop, zorder=0, label=None if label in named else label, **style)
            named.add(label)
        panel.plot(*_extremes(times, values), color=COLOURS[0], linewidth=0.8)


def _extremes(
    times: NDArray[np.floating], values: NDArray[np.floating]
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the lowest and the highest sample of each short stretch of a long signal."""
    if len(values) <= _MOST_POINTS:
        return times, values
    length = -(-2 * len(values) // _MOST_POINTS)
    whole = len(values) // length * length
    blocks = values[:whole].reshape(-1, length)
    starts = np.arange(0, whole, length)
    places = np.sort([starts + blocks.argmin(axis=1), starts + blocks.argmax(axis=1)], axis=0)
    kept = np.concatenate([places.T.reshape(-1), np.arange(whole, len(values))])
    return times[kept], values[kept]


def _between(
    signal: NDArray[np.floating], fs: float, start: float, stop: float
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return times and samples from start to stop."""
    first, last = int(np.ceil(start * fs - 1e-9)), int(np.floor(stop * fs + 1e-9)) + 1
    part = signal[first:last]
    if len(part) < 2:
        raise ValueError(
            f"two samples are needed, but {len(part)} lie between {start:g} and {stop:g} s "
            f"at {fs:g} Hz."
        )
    return np.arange(first, first + len(part)) / fs, part


def _checked_window(between: Any, duration: float) -> tuple[float, float]:
    if between is None:
        return 0.0, duration
    if np.shape(between) != (2,):
        raise TypeError(f"between must be a pair (start, stop) [s], got {between!r}.")
    start, stop = (check_number(edge, "an edge of between", unit="s") for edge in between)
    if not 0 <= start < stop or start >= duration:
        raise ValueError(
            f"between must run from an earlier to a later time within {duration:g} s, "
            f"got {between!r}."
        )
    return start, stop


def _checked_units(units: Any, channels: list[str]) -> dict[str, str]:
    if units is None:
        return {}
    if not isinstance(units, Mapping):
        raise TypeError(f"units must map channels to units, as {{'current': 'A'}}, got {units!r}.")
    return dict(units)
