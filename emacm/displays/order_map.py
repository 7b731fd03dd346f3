"""Pictures of how the order spectrum changes while one recording runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._checks import check_choice, check_count, check_number
from emacm.displays._drawing import (
    MISSING,
    ORDER_LABEL,
    decibels,
    mark_orders_beside,
    one_axes,
    squared,
)
from emacm.displays._tables import (
    check_fault_orders,
    check_values,
)
from emacm.orders.welch import SegmentPlan, samples_per_revolution, segment_plan
from emacm.recordings.inputs import check_channel_names
from emacm.recordings.recording import Recording
from emacm.resampling.angle_recording import AngleStroke
from emacm.resampling.order_resampler import OrderResampler
from emacm.shaft.strokes import ShaftPath

OVERS = ("time", "speed")
_MAP = "magma"  # as even in grey as in colour
_FAINTEST = 40.0  # per cent of the cells, noise mostly, lie below where the colours begin
_NO_TURN = 1e-12  # of the speed; narrower ranges of it are widened to be seen


class OrderMapDisplay:
    """Order spectra of the segments of one recording, over time or over shaft speed.

    Parameters
    ----------
    orders : ndarray of shape (n_orders,)
        Orders of the lines, evenly spaced.
    psd : ndarray of shape (n_segments, n_orders)
        Power spectral density of each segment [unit²/order].
    intervals : ndarray of shape (n_segments, 2)
        When each segment begins and ends [s], in order of time. They may overlap: each is
        then drawn up to the middle of what it has in common with the next.
    speeds : ndarray of shape (n_segments,)
        Mean shaft speed in each segment [rad/s], signed.
    over : {"time", "speed"}
        What runs along x. Over speed, segments of nearly the same speed are averaged.
    n_speeds : int
        Classes of speed, equally wide from the lowest to the highest.
    channel, unit : str
        Name and unit of the channel.
    max_order : float, optional
        Highest order to draw.
    fault_orders : mapping of str to float, optional
        Orders to be marked, by name. Those beyond `max_order` are passed over.

    Attributes
    ----------
    ax_, figure_
        What was drawn on, once `plot` has run.
    colorbar_ : Colorbar
        The scale of colours.

    Raises
    ------
    TypeError, ValueError
        If shapes do not fit, a number is not finite, or a power negative.

    Examples
    --------
    >>> import numpy as np
    >>> display = OrderMapDisplay(
    ...     np.arange(3), np.ones((2, 3)), [[0, 1], [1, 2]], [10.0, 20.0], over="speed"
    ... )
    >>> display.frame().index.get_level_values("speed").tolist()
    [10.0, 20.0]
    """

    ax_: Any
    figure_: Any
    colorbar_: Any

    def __init__(
        self,
        orders: Any,
        psd: Any,
        intervals: Any,
        speeds: Any,
        *,
        over: str = "time",
        n_speeds: int = 24,
        channel: str = "signal",
        unit: str = "unit",
        max_order: float | None = None,
        fault_orders: Mapping[str, float] | None = None,
    ) -> None:
        self.psd = check_values(psd, "psd", (None, None), least=0)
        n_segments, n_orders = self.psd.shape
        self.orders = check_values(orders, "orders", (n_orders,), least=0)
        self.intervals = check_values(intervals, "intervals", (n_segments, 2))
        self.speeds = check_values(speeds, "speeds", (n_segments,))
        if not n_segments or n_orders < 2:
            raise ValueError(f"a map needs segments and two orders, got psd {self.psd.shape}.")
        starts, stops = self.intervals.T
        if np.any(stops <= starts) or np.any(np.diff(starts) <= 0):
            raise ValueError("intervals must run from a start to a later end, in order of time.")
        self.over = check_choice(over, "over", OVERS)
        self.n_speeds = check_count(n_speeds, "n_speeds")
        self.channel = channel
        self.unit = unit
        if max_order is not None:
            max_order = check_number(max_order, "max_order", above=0, unit="orders")
        self.max_order = max_order
        self.fault_orders = check_fault_orders(fault_orders)

    @classmethod
    def from_recording(
        cls,
        recording: Recording,
        channel: str | None = None,
        *,
        theta_s: float = 2 * np.pi / 128,
        revolutions: float = 4,
        overlap: float = 0.5,
        window: Any = "hann",
        direction: str = "strokes",
        min_speed: float = 0.0,
        over: str = "time",
        n_speeds: int = 24,
        unit: str = "unit",
        max_order: float | None = None,
        fault_orders: Mapping[str, float] | None = None,
        ax: Any = None,
    ) -> OrderMapDisplay:
        """Resample a recording, estimate the spectrum of each segment, and draw.

        Parameters
        ----------
        recording : Recording
            One run.
        channel : str, optional
            Which channel. Default: the first.
        theta_s, direction, min_speed
            As for `OrderResampler`.
        revolutions, overlap, window
            As for `OrderPSD`. Long segments tell orders apart, short ones tell times apart.
        over, n_speeds, unit, max_order, fault_orders
            As for the class.
        ax : matplotlib Axes, optional
            Where to draw.

        Returns
        -------
        OrderMapDisplay

        Raises
        ------
        TypeError, ValueError
            If a setting is not what it should be, there is no such channel, or no stroke
            holds a segment.
        """
        if not isinstance(recording, Recording):
            raise TypeError(f"recording must be one Recording, got {type(recording).__name__}.")
        chosen = recording.channels[0] if channel is None else channel
        check_channel_names(recording.channels, [chosen], "the recording")
        resampler = OrderResampler(
            theta_s, channels=[chosen], direction=direction, min_speed=min_speed
        )
        strokes = resampler.fit_transform([recording])[0].strokes
        plan = segment_plan(
            samples_per_revolution(theta_s),
            revolutions=revolutions,
            overlap=overlap,
            window=window,
            max_order=max_order,
        )
        segments = [segment for stroke in strokes for segment in _segments(stroke, plan)]
        if not segments:
            longest = max((stroke.revolutions for stroke in strokes), default=0)
            raise ValueError(
                f"no stroke holds a segment of {plan.revolutions:g} revolutions; the longest has "
                f"{longest:.4g}. Lower revolutions."
            )
        psd, intervals, speeds = (np.array(values) for values in zip(*segments, strict=True))
        display = cls(
            plan.orders,
            psd,
            intervals,
            speeds,
            over=over,
            n_speeds=n_speeds,
            channel=chosen,
            unit=unit,
            max_order=max_order,
            fault_orders=fault_orders,
        )
        return display.plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the numbers: a row a segment (start, stop, speed), a column an order."""
        keys = [*self.intervals.T, self.speeds]
        index = pd.MultiIndex.from_arrays(keys, names=["start", "stop", "speed"])
        return pd.DataFrame(self.psd, index=index, columns=pd.Index(self.orders, name="order"))

    def plot(self, *, ax: Any = None) -> OrderMapDisplay:
        """Draw the map: order upwards, PSD in dB as colour, hatched where there is none.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw. Default: a new figure.

        Returns
        -------
        OrderMapDisplay
            Itself.
        """
        ax = one_axes(ax)
        edges, psd = self._over_time() if self.over == "time" else self._over_speed()
        top = self.orders[-1] if self.max_order is None else self.max_order
        # The first line is bent by detrending, and is no fault's order.
        drawn = (self.orders > 0) & (self.orders <= top)
        half = (self.orders[1] - self.orders[0]) / 2
        heights = np.append(self.orders[drawn] - half, self.orders[drawn][-1] + half)
        power = np.ma.masked_invalid(decibels(psd[:, drawn]).T)
        faintest = np.percentile(power.compressed(), _FAINTEST) if power.count() else None
        mesh = ax.pcolormesh(edges, heights, power, vmin=faintest, cmap=_MAP, rasterized=True)
        ax.patch.set(facecolor="white", edgecolor=MISSING, hatch="////")
        name = "time [s]" if self.over == "time" else "shaft speed [rad/s]"
        ax.set(xlabel=name, ylabel=ORDER_LABEL, ylim=(heights[0], top))
        mark_orders_beside(ax, self.fault_orders)
        self.colorbar_ = ax.figure.colorbar(mesh, ax=ax, extend="min")
        label = f"PSD of {self.channel} [dB re 1 {squared(self.unit)}/order]"
        self.colorbar_.set_label(label)
        self.ax_, self.figure_ = ax, ax.figure
        return self

    def _over_time(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return edges along time and the spectra between; NaN where no segment lies."""
        starts, stops = self.intervals.T
        edges, rows = [starts[0]], []
        for i, spectrum in enumerate(self.psd):
            rows.append(spectrum)
            following = starts[i + 1] if i + 1 < len(starts) else np.inf
            if following <= stops[i]:
                edges.append((following + stops[i]) / 2)
            else:
                edges.append(stops[i])
                if np.isfinite(following):
                    rows.append(np.full_like(spectrum, np.nan))
                    edges.append(following)
        return np.array(edges), np.array(rows)

    def _over_speed(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return edges along speed and the mean spectra between; NaN where no segment lies."""
        low, high = self.speeds.min(), self.speeds.max()
        if high - low <= _NO_TURN * max(abs(low), abs(high)):
            low, high = low - 0.5, high + 0.5
        edges = np.linspace(low, high, self.n_speeds + 1)
        kind = np.clip(np.digitize(self.speeds, edges) - 1, 0, self.n_speeds - 1)
        rows = np.full((self.n_speeds, self.psd.shape[1]), np.nan)
        for k in np.unique(kind):
            rows[k] = self.psd[kind == k].mean(axis=0)
        return edges, rows


def _segments(stroke: AngleStroke, plan: SegmentPlan) -> Iterator[tuple[Any, Any, float]]:
    """Yield the spectrum, the interval [s] and the mean speed [rad/s] of each segment."""
    length = plan.n_per_segment
    if stroke.n_angles < length:
        return
    signals, theta_s = stroke.signals, stroke.parent.theta_s
    for start in range(0, stroke.n_angles - length + 1, plan.step):
        spectrum = plan.average_of([signals[:, start : start + length]])[0]
        interval = _times_at(stroke.path, theta_s * np.array([start, start + length - 1]))
        turned = (length - 1) * theta_s * (stroke.direction or 1)
        yield spectrum, interval, turned / (interval[1] - interval[0])


def _times_at(path: ShaftPath, travel: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return when the shaft has run these angles [s]."""
    # Below min_speed it may turn back a little, and interpolation needs a rising angle.
    run = np.maximum.accumulate(np.asarray(path.travel))
    return path.start_time + np.interp(travel, run, np.arange(len(run))) / path.fs
