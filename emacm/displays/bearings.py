"""Envelope order spectra with predicted fault lines, and kurtograms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from emacm._checks import check_choice
from emacm.displays import drawing as _drawing
from emacm.displays import drawn_values as _tables
from emacm.displays.drawing import Display
from emacm.envelopes.kurtogram import Kurtogram, kurtogram
from emacm.machine.bearing_recipe import envelope_spectra
from emacm.machine.fault_lines import LineLevels, resolved
from emacm.machine.fault_orders import Parts, damage_series
from emacm.machine.fault_spectra import longest_stroke
from emacm.recordings.recording import Recording


@dataclass(eq=False, repr=False)
class FaultLinesDisplay(Display):
    """Order spectrum of one recording with the lines by which `find_faults` names a fault.

    Predicted lines are marked with their slip range and their names, found lines by a symbol for
    each fault. The background is the local median.

    Parameters
    ----------
    orders : array-like of shape (n_orders,)
        Evenly spaced orders.
    spectrum : array-like of shape (n_orders,)
        Order spectrum, for bearings that of the envelope [U²/order].
    parts : part, or sequence of parts
        `Bearing`, `Gear` and so on, or mappings of fault names to orders.
    faults : sequence of str, optional
        Names of the faults to mark. Default: all.
    channel : str
        Name of the channel, for the label.

    Attributes
    ----------
    ax_, figure_
        Axes and figure, set when the display is drawn.

    Raises
    ------
    TypeError, ValueError
        If a fault is not one of the parts, or one of its three lines lies outside of the orders.

    Examples
    --------
    >>> import numpy as np
    >>> orders = np.arange(0, 10.01, 0.1)
    >>> spectrum = np.where(np.isin(orders.round(1), [2.5, 5.0]), 100.0, 1.0)
    >>> FaultLinesDisplay(orders, spectrum, {"BPFO": 2.5}).frame()["height"].tolist()
    [20.0, 20.0, 0.0]
    """

    orders: Any
    spectrum: Any
    parts: Any
    faults: Sequence[str] | None = field(default=None, kw_only=True)
    channel: str = field(default="signal", kw_only=True)

    def __post_init__(self) -> None:
        self.orders, self.spectrum = np.asarray(self.orders), np.asarray(self.spectrum)
        series = damage_series(self.parts, 3)
        for name in self.faults or ():
            check_choice(name, "faults", tuple(fault.name for fault in series))
        shown = [f for f in series if self.faults is None or f.name in self.faults]
        self._series = resolved(shown, self.orders)
        self._levels = LineLevels(self.orders, self._series, 0.02, 0.5, without_shaft=True)

    @classmethod
    def from_recording(
        cls,
        recording: Recording,
        parts: Parts,
        *,
        channel: str | None = None,
        ax: Any = None,
        **options: Any,
    ) -> FaultLinesDisplay:
        """Compute the spectrum by `bearing_recipe`, and draw it with three lines of each fault.

        Parameters
        ----------
        recording : Recording
            Vibration as measured.
        parts
            As for the class.
        channel : str, optional
            Default: the first one.
        ax : matplotlib Axes, optional
            Where to draw.
        **options
            As for the class: faults.

        Returns
        -------
        FaultLinesDisplay

        Raises
        ------
        TypeError, ValueError
            If an option is invalid, there is no such channel, or the recording is too short.
        """
        chosen = _tables.chosen_channels(recording, channel and [channel])[0]
        length = min(25, max(1, int(longest_stroke(recording))))  # as `find_faults`
        spectra = envelope_spectra(damage_series(parts, 3), 0.02, length, [chosen])
        (spectrum,) = np.asarray(spectra.fit_transform([recording]))
        orders = spectra[-1].orders_
        return cls(orders, spectrum, parts, channel=chosen, **options).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the lines: one row per fault and harmonic.

        Columns: "predicted" and "found" [orders], "low" and "high" (the slip range), and "height"
        above the local background [dB].
        """
        _, slips, heights = self._levels.measure(self.spectrum[np.newaxis])
        rows = []
        for fault, slip, lines in zip(self._series, slips[0], heights, strict=True):
            reach = self._levels.slip if fault.slips else 0.0
            for number, (order, height) in enumerate(zip(fault.orders, lines[0], strict=True), 1):
                ends = (order * (1 - reach), order * (1 + reach))
                rows.append((fault.name, number, order, order * (1 + slip), *ends, height))
        columns = ["fault", "harmonic", "predicted", "found", "low", "high", "height"]
        return pd.DataFrame(rows, columns=columns).set_index(["fault", "harmonic"])

    def _draw(self, ax: Any) -> Any:
        (ax,) = _drawing.panel_axes(ax, height=3.8)
        table = self.frame()
        drawn = (self.orders > 0) & (self.orders <= table["high"].max() + 0.5)
        background = self._levels.background(self.spectrum[np.newaxis])[0]
        shown = self.orders[drawn]
        levels = _drawing.decibels(np.array([self.spectrum, background])[:, drawn])
        ax.plot(shown, levels[0], linewidth=0.9, color="0.35", label="order spectrum")
        ax.plot(shown, levels[1], "--", linewidth=1.4, color="0", label="local background")
        step = self.orders[1] - self.orders[0]
        for number, fault in enumerate(self._series, 1):
            lines = table.loc[fault.name]
            places = np.rint((lines["found"].to_numpy() - self.orders[0]) / step).astype(int)
            near = np.clip(places[:, np.newaxis] + [-1, 0, 1], 0, len(self.orders) - 1)
            tops = near[np.arange(len(near)), self.spectrum[near].argmax(axis=1)]
            heights = " ".join(f"{height:z.0f}" for height in lines["height"])
            marker = _drawing.style_of(_drawing.MARKERS, number)
            style = {"color": _drawing.colour_of(number), "label": f"{fault.name}: {heights} dB"}
            top = _drawing.decibels(self.spectrum[tops])
            ax.plot(self.orders[tops], top, linestyle="", marker=marker, markersize=5, **style)
        ax.set_xlim(0, shown[-1])
        marks = table.rename(columns={"predicted": "order"})[["order", "low", "high"]]
        marks.index = [name if k == 1 else f"{k}x{name}" for name, k in table.index]
        gap = _drawing.mark_orders(ax, marks)
        ax.set_xlabel(_drawing.ORDER_LABEL)
        _drawing.label_y(ax, f"envelope of {self.channel}", "dB re 1/order")
        _drawing.legend_above(ax, gap=gap)
        return ax


@dataclass(eq=False, repr=False)
class KurtogramDisplay(Display):
    """Spectral kurtosis of the bands of a signal; the band with the largest one is outlined.

    Parameters
    ----------
    found : Kurtogram
        Result of `kurtogram`.
    channel : str
        Name of the channel, for the label.

    Attributes
    ----------
    ax_, figure_
        Axes and figure, set when the display is drawn.
    colorbar_ : Colorbar
        Its colour bar.

    Notes
    -----
    Source of this kind of figure: J. Antoni, Mech. Syst. Signal Process. 21(1), 108-124, 2007.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import kurtogram
    >>> noise = np.random.default_rng(0).standard_normal(20_000)
    >>> len(KurtogramDisplay(kurtogram(noise, 10_000)).frame())
    401
    """

    found: Kurtogram
    channel: str = field(default="signal", kw_only=True)

    @classmethod
    def from_signal(
        cls, signal: ArrayLike, fs: float, *, channel: str = "signal", ax: Any = None
    ) -> KurtogramDisplay:
        """Compute the kurtogram of a signal, and draw it.

        Parameters
        ----------
        signal, fs
            As for `kurtogram`.
        channel : str
            Name of the channel, for the label.
        ax : matplotlib Axes, optional
            Where to draw.

        Returns
        -------
        KurtogramDisplay
        """
        return cls(kurtogram(signal, fs), channel=channel).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return one row per band: "width" and "centre" [Hz], "kurtosis"."""
        found = self.found
        widths = np.repeat(found.widths, [len(centres) for centres in found.centres])
        columns = {"width": widths, "centre": np.concatenate(found.centres)}
        return pd.DataFrame(columns | {"kurtosis": np.concatenate(found.kurtosis)})

    def _draw(self, ax: Any) -> Any:
        (ax,) = _drawing.panel_axes(ax, height=3.0)
        found = self.found
        highest = max(float(values.max()) for values in found.kurtosis)
        scale = {"vmin": 0.0, "vmax": max(highest, 0.1), "cmap": "viridis", "rasterized": True}
        for level, (width, centres, values) in enumerate(
            zip(found.widths, found.centres, found.kurtosis, strict=True)
        ):
            edges = np.append(centres - width / 4, centres[-1] + width / 4)  # they overlap by half
            mesh = ax.pcolormesh(edges, [level - 0.5, level + 0.5], values[np.newaxis], **scale)
        low, high = found.band
        level = int(np.argmin(np.abs(np.array(found.widths) - (high - low))))
        style = {"color": _drawing.COLOURS[1], "linewidth": 2}
        corners = [low, high, high, low, low], level + np.array([-0.5, -0.5, 0.5, 0.5, -0.5])
        ax.plot(*corners, label=f"{low:.0f} to {high:.0f} Hz", clip_on=False, **style)
        ax.set(xlabel="frequency [Hz]", ylabel="width of the band [Hz]", xlim=(0, found.fs / 2))
        ax.set_yticks(range(len(found.widths)), [f"{width:.4g}" for width in found.widths])
        ax.set_ylim(len(found.widths) - 0.5, -0.5)
        ax.patch.set(facecolor="white", edgecolor=_drawing.MISSING, hatch="////")
        self.colorbar_ = ax.figure.colorbar(mesh, ax=ax)
        self.colorbar_.set_label(f"spectral kurtosis of {self.channel} [1]")
        _drawing.legend_above(ax)
        return ax
