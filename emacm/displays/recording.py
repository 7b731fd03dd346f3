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

# Direction of a stroke: label, grey and hatch of its background.
_STROKES = {1: ("forward stroke", "0.93", ""), -1: ("reverse stroke", "0.85", "....")}

Line = tuple[NDArray[np.floating], NDArray[np.floating]]  # times and values, equally long


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
        chosen = _tables.chosen_channels(recording, channels)
        part = recording.select(chosen)
        start = 0.0
        if between is not None:
            slowest = min(*part.fs.values(), part.shaft_fs)
            start = np.ceil(between[0] * slowest - 1e-6) / slowest  # as in `Recording.cut`
            part = part.cut(*between)
        fs, found = part.shaft_fs, part.strokes(min_speed) if shade_strokes else []
        strokes = [(start + s.start / fs, start + (s.stop - 1) / fs, s.direction) for s in found]
        return cls(part, start=start, units=units, strokes=strokes).plot(ax=ax)

    def _lines(self) -> dict[str, Line]:
        """Return the times and values of each channel, and of the shaft speed."""
        part = self.recording
        rates = {**part.fs, "shaft speed": part.shaft_fs}
        sampled = {**part.signals, "shaft speed": part.velocity}
        return {
            name: (self.start + np.arange(len(values)) / rates[name], values)
            for name, values in sampled.items()
        }

    def frame(self) -> pd.DataFrame:
        """Return a column ``value``, indexed by channel (or "shaft speed") and time [s]."""
        tables = {
            name: pd.DataFrame({"value": values}, index=pd.Index(times, name="time"))
            for name, (times, values) in self._lines().items()
        }
        return pd.concat(tables, names=["quantity"])

    def _draw(self, ax: Any) -> Any:
        lines = self._lines()
        axes = _drawing.panel_axes(ax, len(lines), height=1.3)
        units = self.recording.units if self.units is None else self.units
        envelopes = _tables.envelopes_in(self.recording)
        for panel, (name, line) in zip(axes, lines.items(), strict=True):
            self._shade_strokes(panel)
            panel.plot(*line, color=_drawing.PLAIN, linewidth=0.8)
            panel.set_xlim(self.start, max(times[-1] for times, _ in lines.values()))
            _drawing.label_y(panel, *_tables.quantity_of("", name, units, envelopes))
        axes[-1].axhline(0, color="0.4", linewidth=0.6)
        _drawing.label_y(axes[-1], "shaft speed", "rad/s")
        _drawing.label_x(axes, "time [s]")
        _drawing.legend_above(axes[0])
        return axes

    def _shade_strokes(self, panel: Any) -> None:
        for start, stop, direction in self.strokes:
            label, grey, hatch = _STROKES[direction]
            named = label in panel.get_legend_handles_labels()[1]
            style = {"facecolor": grey, "edgecolor": "0.7", "hatch": hatch, "linewidth": 0}
            panel.axvspan(start, stop, zorder=0, label=None if named else label, **style)
