"""Pictures of order spectra: power over orders, one line for each group of recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_choice, check_number
from emacm.displays._drawing import (
    ORDER_LABEL,
    decibels,
    legend_beside,
    line_style,
    mark_orders,
    name_panels_below,
    name_side,
    one_axes,
    panel_axes,
    squared,
    wrapped,
)
from emacm.displays._tables import (
    channel_blocks,
    channel_list,
    check_fault_orders,
    check_values,
    means_by_label,
    pipeline_until,
    unit_of,
)
from emacm.orders.columns import column_names, parse_order_columns
from emacm.orders.order_psd import OrderPSD
from emacm.orders.welch import SCALINGS

SCALES = ("dB", "linear")


class OrderSpectrumDisplay:
    """Order spectra, one line for each group of recordings, one panel for each channel.

    Parameters
    ----------
    orders : ndarray of shape (n_orders,)
        Orders of the lines.
    spectra : mapping of str to ndarray of shape (n_orders,) or (n_channels, n_orders)
        Power spectral density [unit²/order] by label.
    channel : str or sequence of str
        Channel they belong to, or the channels of their rows.
    unit : str or mapping of str to str
        Unit of the channel, or of each.
    max_order : float, optional
        Highest order to draw.
    fault_orders : mapping of str to float, optional
        Orders to be marked, by name. Those beyond `max_order` are passed over.
    scale : {"dB", "linear"}
        Scale of the power. In dB nothing is drawn where it is 0.
    scaling : {"density", "spectrum"}
        What `OrderPSD` estimated: unit²/order or unit².

    Attributes
    ----------
    ax_ : Axes, or ndarray of Axes of shape (n_channels,) if channels are a sequence
        What was drawn on, once `plot` has run.
    figure_ : Figure
        The figure of `ax_`.

    Raises
    ------
    TypeError, ValueError
        If orders do not increase, or spectra do not fit them, are negative or not finite.

    Examples
    --------
    >>> import numpy as np
    >>> display = OrderSpectrumDisplay(np.arange(3), {"healthy": np.array([0.0, 2.0, 1.0])})
    >>> display.frame()["healthy"].tolist()
    [0.0, 2.0, 1.0]
    """

    ax_: Any
    figure_: Any

    def __init__(
        self,
        orders: NDArray[np.floating],
        spectra: Mapping[str, NDArray[np.floating]],
        *,
        channel: str | Sequence[str] = "signal",
        unit: str | Mapping[str, str] = "unit",
        max_order: float | None = None,
        fault_orders: Mapping[str, float] | None = None,
        scale: str = "dB",
        scaling: str = "density",
    ) -> None:
        self.orders = check_values(orders, "orders", (None,), least=0)
        if len(self.orders) < 2 or np.any(np.diff(self.orders) <= 0):
            raise ValueError(f"orders must be at least two, and increase; got {orders!r}.")
        shape: tuple[int, ...] = (len(self.orders),)
        if not isinstance(channel, str):
            shape = (len(channel_list(channel)), *shape)
        self.spectra = {
            label: check_values(values, f"the spectrum of {label!r}", shape, least=0)
            for label, values in spectra.items()
        }
        self.channel = channel
        self.unit = unit
        if max_order is not None:
            max_order = check_number(max_order, "max_order", above=0, unit="orders")
        self.max_order = max_order
        self.fault_orders = check_fault_orders(fault_orders)
        self.scale = check_choice(scale, "scale", SCALES)
        self.scaling = check_choice(scaling, "scaling", SCALINGS)

    @classmethod
    def from_table(
        cls,
        psd: Any,
        channel: str | Sequence[str] | None = None,
        *,
        labels: ArrayLike | None = None,
        unit: str | Mapping[str, str] = "unit",
        max_order: float | None = None,
        fault_orders: Mapping[str, float] | None = None,
        scale: str = "dB",
        scaling: str = "density",
        ax: Any = None,
    ) -> OrderSpectrumDisplay:
        """Draw the mean spectrum of the recordings of each label.

        Parameters
        ----------
        psd : OrderTable or DataFrame of shape (n_recordings, n_columns)
            What `OrderPSD` returns.
        channel : str or sequence of str, optional
            Which channels to draw, as in its column names. Default: all.
        labels : array-like of shape (n_recordings,), optional
            Label of each recording. Default: one line for all.
        unit, max_order, fault_orders, scale, scaling
            As for the class.
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one for each channel.

        Returns
        -------
        OrderSpectrumDisplay

        Raises
        ------
        ValueError
            If the table carries no axis or no such channel, or labels do not fit it.
        """
        names = column_names(psd)
        blocks = channel_blocks(
            None if names is None else parse_order_columns(names),
            channel,
            remedy="pass what OrderPSD returns, with its columns",
        )
        orders = blocks[0].orders
        for block in blocks:
            if not np.array_equal(block.orders, orders):
                raise ValueError(
                    f"channels {blocks[0].channel!r} and {block.channel!r} have other orders; "
                    f"draw them one by one."
                )
        single = channel if isinstance(channel, str) else None
        means = means_by_label(psd, labels, single or "all recordings")
        spectra = {
            label: mean[blocks[0].columns]
            if single
            else np.stack([mean[block.columns] for block in blocks])
            for label, mean in means.items()
        }
        display = cls(
            orders,
            spectra,
            channel=single or [block.channel for block in blocks],
            unit=unit,
            max_order=max_order,
            fault_orders=fault_orders,
            scale=scale,
            scaling=scaling,
        )
        return display.plot(ax=ax)

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: Any,
        channel: str | Sequence[str] | None = None,
        *,
        labels: ArrayLike | None = None,
        unit: str | Mapping[str, str] = "unit",
        max_order: float | None = None,
        fault_orders: Mapping[str, float] | None = None,
        scale: str = "dB",
        ax: Any = None,
    ) -> OrderSpectrumDisplay:
        """Estimate the spectra of recordings by a fitted pipeline, and draw them.

        Parameters
        ----------
        estimator : OrderPSD, or Pipeline with such a step
            Fitted. What comes after the spectra has no say.
        X : list of Recording
            Recordings, or whatever the first step takes.
        channel : str or sequence of str, optional
            Which channels to draw. Default: all.
        labels, unit, max_order, fault_orders, scale, ax
            As for `from_table`.

        Returns
        -------
        OrderSpectrumDisplay

        Raises
        ------
        ValueError
            If there is no `OrderPSD`, and as for `from_table`.
        """
        step, before = pipeline_until(estimator, lambda s: isinstance(s, OrderPSD), "an OrderPSD")
        psd = step.transform(X if before is None else before.transform(X))
        return cls.from_table(
            psd,
            channel,
            labels=labels,
            unit=unit,
            max_order=max_order,
            fault_orders=fault_orders,
            scale=scale,
            scaling=step.scaling,
            ax=ax,
        )

    def frame(self) -> pd.DataFrame:
        """Return the numbers: a row an order, a column a label (or channel and label)."""
        index = pd.Index(self.orders, name="order")
        if isinstance(self.channel, str):
            return pd.DataFrame({**self.spectra}, index=index)
        columns = {
            (channel, label): values[i]
            for i, channel in enumerate(self.channel)
            for label, values in self.spectra.items()
        }
        table = pd.DataFrame(columns, index=index)
        return table.rename_axis(columns=["channel", "label"])

    def plot(self, *, ax: Any = None) -> OrderSpectrumDisplay:
        """Draw the spectra against the order.

        Parameters
        ----------
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one for each channel. Default: a new figure.

        Returns
        -------
        OrderSpectrumDisplay
            Itself.
        """
        if isinstance(self.channel, str):
            axes = np.array([one_axes(ax)], dtype=object)
        else:
            axes = panel_axes(ax, len(self.channel), height=2.0)
        for i, (panel, channel) in enumerate(zip(axes, channel_list(self.channel), strict=True)):
            for number, (label, values) in enumerate(self.spectra.items()):
                self._draw_line(panel, np.atleast_2d(values)[i], label, number)
            panel.set_xlim(0, self.orders[-1] if self.max_order is None else self.max_order)
            name_side(panel, *self._power_label(channel))
            if self.scale == "linear":
                panel.set_ylim(bottom=0)
            mark_orders(panel, self.fault_orders, named=i == 0)
        name_panels_below(axes, ORDER_LABEL)
        legend_beside(axes[0])
        self.ax_ = axes[0] if isinstance(self.channel, str) else axes
        self.figure_ = axes[0].figure
        return self

    def _draw_line(self, panel: Any, values: NDArray[np.floating], label: str, number: int) -> None:
        top = self.orders[-1] if self.max_order is None else self.max_order
        # The first line is bent by detrending, and is no fault's order.
        drawn = (self.orders > 0) & (self.orders <= top)
        power = decibels(values[drawn]) if self.scale == "dB" else values[drawn]
        style = line_style(number)
        panel.plot(self.orders[drawn], power, label=wrapped(label), linewidth=1.2, **style)

    def _power_label(self, channel: str) -> tuple[str, str]:
        unit = squared(unit_of(self.unit, channel))
        name, per = ("PSD", "/order") if self.scaling == "density" else ("power", "")
        reference = "dB re 1 " if self.scale == "dB" else ""
        return f"{name} of {channel}", f"{reference}{unit}{per}"
