"""Amplitude and phase of orders over shaft speed or time: Bode plot and polar plot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._checks import check_choice
from emacm.displays import drawing, drawn_values
from emacm.displays.drawing import Display
from emacm.orders.order_track import order_track
from emacm.recordings.names import unit_factor
from emacm.recordings.recording import Recording


@dataclass(eq=False, repr=False)
class OrderTrackDisplay(Display):
    """Amplitude and phase of orders over speed (Bode plot) or time, or as a polar plot.

    Parameters
    ----------
    track : DataFrame
        Rows of one channel of the result of `emacm.order_track`.
    over : {"speed", "time"}
        Quantity of the x axis.
    polar : bool
        Whether to draw amplitude and phase as a curve in the plane, with marks of the speed in rpm.
    unit : str
        Unit of the channel.

    Attributes
    ----------
    ax_, figure_
        Axes and figure, set when the display is drawn: one Axes for the amplitude and one for the
        phase; of a polar plot, one for each order.

    Raises
    ------
    TypeError, ValueError
        If an option is invalid, or the table is not of one channel.

    Examples
    --------
    >>> turning = Recording({"x": np.cos(np.arange(400.0))}, 10, angle=np.arange(400.0))
    >>> display = OrderTrackDisplay(order_track(turning, 1), over="time")
    >>> display.frame()["amplitude"].round(3).unique()
    array([1.])
    """

    track: pd.DataFrame
    over: str = field(default="speed", kw_only=True)
    polar: bool = field(default=False, kw_only=True)
    unit: str = field(default="unit", kw_only=True)

    def __post_init__(self) -> None:
        check_choice(self.over, "over", ("speed", "time"))
        names = self.track["channel"].unique()
        if len(names) != 1:
            raise ValueError(f"track must have the rows of one channel, got {list(names)}.")

    @classmethod
    def from_recording(
        cls,
        recording: Recording,
        orders: float | Sequence[float],
        channel: str | None = None,
        *,
        revolutions: float = 8,
        ax: Any = None,
        **options: Any,
    ) -> OrderTrackDisplay:
        """Follow orders of a channel, and draw them.

        Parameters
        ----------
        recording : Recording
            One run.
        orders, revolutions
            As for `emacm.order_track`.
        channel : str, optional
            Channel to draw. Default: the first.
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw.
        **options
            As for the class: over, polar, unit.

        Returns
        -------
        OrderTrackDisplay

        Raises
        ------
        TypeError, ValueError
            As for `emacm.order_track`.
        """
        (name, *_) = drawn_values.chosen_channels(recording, channel and [channel])
        track = order_track(recording, orders, revolutions=revolutions, channels=[name])
        options.setdefault("unit", recording.units.get(name, "unit"))
        return cls(track, **options).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the table."""
        return self.track

    def _draw(self, ax: Any) -> Any:
        lines = dict(iter(self.track.groupby("order", sort=False)))
        return self._draw_polar(ax, lines) if self.polar else self._draw_panels(ax, lines)

    def _draw_panels(self, ax: Any, lines: dict[float, pd.DataFrame]) -> Any:
        axes = drawing.panel_axes(ax, 2, height=2.0)
        for number, (order, rows) in enumerate(lines.items(), 1):
            for part, direction in _parts(rows):
                rpm = part["speed"].abs() / unit_factor("rpm", "velocity")
                x = part["time"] if self.over == "time" else rpm
                label = f"order {order:g}{'' if direction > 0 else ', reverse'}"
                if label in axes[0].get_legend_handles_labels()[1]:
                    label = "_"
                style: Any = {"color": drawing.colour_of(number), "label": label, "linewidth": 1.1}
                style["linestyle"] = "-" if direction > 0 else "--"
                style["marker"] = "." if len(part) == 1 else ""
                axes[0].plot(x, part["amplitude"], **style)
                axes[1].plot(*_broken(x.to_numpy(), np.degrees(part["phase"])), **style)
        words = f"amplitude of {self.track['channel'].iloc[0]}"
        drawing.label_y(axes[0], words, f"{self.unit}, peak")
        drawing.label_y(axes[1], "phase", "degrees")
        axes[0].set_ylim(0, 1.08 * self.track["amplitude"].max() or 1)
        axes[1].set(ylim=(-190, 190), yticks=range(-180, 181, 90))
        for panel in axes:
            panel.grid(color="0.9")
        drawing.label_x(axes, "time [s]" if self.over == "time" else "shaft speed [rpm]")
        drawing.legend_above(axes[0])
        return axes

    def _draw_polar(self, ax: Any, lines: dict[float, pd.DataFrame]) -> Any:
        polar: Any = {"subplot_kw": {"projection": "polar"}, "share_x": False}
        axes = drawing.panel_axes(ax, len(lines), height=4.0, **polar)
        for panel, (number, (order, rows)) in zip(axes, enumerate(lines.items(), 1), strict=True):
            for part, direction in _parts(rows):
                line, colour = "-" if direction > 0 else "--", drawing.colour_of(number)
                panel.plot(part["phase"], part["amplitude"], line, color=colour, linewidth=1.1)
            for row in rows.iloc[_apart(rows)].itertuples():
                panel.plot(row.phase, row.amplitude, ".", color="0.2")
                text = f"{abs(row.speed) / unit_factor('rpm', 'velocity'):.0f}"
                place, small = (row.phase, row.amplitude), drawing.SMALL
                panel.annotate(text, place, (4, 2), textcoords="offset points", fontsize=small)
            of = f"of {self.track['channel'].iloc[0]}\n[{self.unit}, peak]; marks: rpm"
            panel.set_title(f"order {order:g} {of}", fontsize=drawing.SMALL)
            panel.tick_params(labelsize=drawing.SMALL)
        return axes


def _parts(rows: pd.DataFrame) -> Iterator[tuple[pd.DataFrame, int]]:
    """Yield consecutive rows of a stroke, and their direction."""
    speed = rows["speed"].to_numpy()
    turned = np.diff(rows["time"]) * np.abs(speed[1:] + speed[:-1]) / 2
    apart = turned > 1.5 * np.median(turned) if len(turned) else np.zeros(0, bool)
    breaks = np.flatnonzero(apart | (speed[1:] * speed[:-1] < 0)) + 1
    for part in np.split(np.arange(len(rows)), breaks):
        yield rows.iloc[part], int(np.sign(speed[part[0]]))


def _apart(rows: pd.DataFrame) -> list[int]:
    """Return rows whose places in the plane are so far apart that their marks can be read."""
    places = (rows["amplitude"] * np.exp(1j * rows["phase"])).to_numpy()
    marked = [0]
    for number, place in enumerate(places):
        if np.abs(place - places[marked]).min() > 0.25 * np.abs(places).max():
            marked.append(number)
    return marked


def _broken(
    x: NDArray[np.floating], degrees: pd.Series
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return a line that is interrupted where the phase passes 180 degrees."""
    y = degrees.to_numpy()
    jumps = np.flatnonzero(np.abs(np.diff(y)) > 180) + 1
    return np.insert(x, jumps, np.nan), np.insert(y, jumps, np.nan)
