"""Order spectra: power over the order, one line for each group of recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_choice
from emacm.displays import _drawing, _tables
from emacm.displays._display import PowerDisplay
from emacm.orders.columns import column_names, parse_order_columns
from emacm.orders.order_psd import OrderPSD
from emacm.orders.welch import SCALINGS


@dataclass(eq=False, repr=False)
class OrderSpectrumDisplay(PowerDisplay):
    """Order spectra, one line for each group of recordings, one panel for each channel.

    Parameters
    ----------
    orders : ndarray of shape (n_orders,)
        Orders of the spectral lines.
    spectra : mapping of str to ndarray of shape (n_orders,) or (n_channels, n_orders)
        Power spectral density [unit²/order] by label.
    channel : str or sequence of str
        Channel of the spectra, or the channels of their rows.
    unit : str or mapping of str to str
        Unit of the channel, or of each.
    envelopes : mapping of str to {"amplitude", "squared"}, optional
        Channels that are envelopes, see `EnvelopeDetector`: their axes show the envelope order
        spectrum and its unit. The unit to be given is that of the measured channel.
    max_order : float, optional
        Highest order to draw.
    fault_orders : DataFrame of `emacm.fault_orders`, or mapping of str to float, optional
        Predicted fault orders, which are marked. Those above `max_order` are not drawn.
    slip : float
        Largest relative slip: a line that slips may be lower or higher by this fraction of its
        order, and this range is shaded. In a mapping every order may slip.
    healthy : str
        Label of the healthy state: it is first in the legend and always has the same colour.
    scale : {"dB", "linear"}
        Scale of the power. In dB nothing is drawn where it is 0.
    scaling : {"density", "spectrum"}
        As for `OrderPSD`: unit²/order or unit².

    Attributes
    ----------
    ax_ : Axes, or ndarray of Axes of shape (n_channels,) if `channel` is a sequence
        Set when the display is drawn.
    figure_ : Figure
        Figure of these Axes.

    Raises
    ------
    TypeError, ValueError
        If orders do not increase, spectra do not fit them, are negative or not finite, or an
        option is invalid.

    Examples
    --------
    >>> import numpy as np
    >>> display = OrderSpectrumDisplay(np.arange(3), {"healthy": np.array([0.0, 2.0, 1.0])})
    >>> display.frame()["healthy"].tolist()
    [0.0, 2.0, 1.0]
    """

    _step = OrderPSD
    _from_step = ("scaling",)

    orders: Any
    spectra: Any
    channel: Any = field(default="signal", kw_only=True)
    max_order: float | None = field(default=None, kw_only=True)
    scaling: str = field(default="density", kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.orders = _tables.check_values(self.orders, "orders", (None,), least=0)
        if len(self.orders) < 2 or np.any(np.diff(self.orders) <= 0):
            raise ValueError(f"orders must be at least two, and increase; got {self.orders!r}.")
        shape: tuple[int, ...] = (len(self.orders),)
        if not isinstance(self.channel, str):
            shape = (len(_tables.channel_list(self.channel)), *shape)
        self.spectra = {
            str(label): _tables.check_values(values, f"the spectrum of {label!r}", shape, least=0)
            for label, values in self.spectra.items()
        }
        _tables.check_upper_order(self.max_order)
        check_choice(self.scaling, "scaling", SCALINGS)

    @classmethod
    def from_table(
        cls,
        table: Any,
        channel: str | Sequence[str] | None = None,
        *,
        labels: ArrayLike | None = None,
        ax: Any = None,
        **options: Any,
    ) -> OrderSpectrumDisplay:
        """Draw the mean spectrum of the recordings of each label.

        Parameters
        ----------
        table : OrderTable or DataFrame of shape (n_recordings, n_columns)
            Result of `OrderPSD`.
        channel : str or sequence of str, optional
            Channels to draw, as in the column names. Default: all.
        labels : array-like of shape (n_recordings,), optional
            Label of each recording. Default: the mean of all.
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one Axes for each channel.
        **options
            As for the class: unit, envelopes, max_order, fault_orders, slip, healthy, scale,
            scaling.

        Returns
        -------
        OrderSpectrumDisplay

        Raises
        ------
        TypeError, ValueError
            If the table has no order axis or no such channel, labels do not fit it, or an option
            is invalid.
        """
        names = column_names(table)
        parsed = None if names is None else parse_order_columns(names)
        blocks = _tables.channel_blocks(parsed, channel)
        orders = blocks[0].orders
        for block in blocks:
            if not np.array_equal(block.orders, orders):
                raise ValueError(
                    f"channels {blocks[0].channel!r} and {block.channel!r} have different orders; "
                    f"draw each in a display of its own."
                )
        single = channel if isinstance(channel, str) else None
        means = _tables.means_by_label(table, labels, single or "all recordings")
        rows = {name: [mean[b.columns] for b in blocks] for name, mean in means.items()}
        spectra = {name: each[0] if single else np.stack(each) for name, each in rows.items()}
        channels = single or [block.channel for block in blocks]
        return cls(orders, spectra, channel=channels, **options).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the spectra: one row per order, one column per label (or channel and label)."""
        index = pd.Index(self.orders, name="order")
        if isinstance(self.channel, str):
            return pd.DataFrame({**self.spectra}, index=index)
        columns = {
            (channel, label): values[i]
            for i, channel in enumerate(self.channel)
            for label, values in self.spectra.items()
        }
        return pd.DataFrame(columns, index=index).rename_axis(columns=["channel", "label"])

    def _draw(self, ax: Any) -> Any:
        channels = _tables.channel_list(self.channel)
        axes = _drawing.panel_axes(ax, len(channels), height=3.8 if len(channels) == 1 else 2.0)
        gap = 0.0
        for i, (panel, channel) in enumerate(zip(axes, channels, strict=True)):
            for label, number in _drawing.state_numbers(self.spectra, self.healthy).items():
                self._draw_line(panel, np.atleast_2d(self.spectra[label])[i], label, number)
            panel.set_xlim(0, self.orders[-1] if self.max_order is None else self.max_order)
            if self.scale == "linear":
                panel.set_ylim(bottom=0)
            density = self.scaling == "density"
            self._label_power(panel, channel, *(("PSD", "/order") if density else ("power",)))
            gap = max(gap, _drawing.mark_orders(panel, self.fault_orders, named=i == 0))
        _drawing.label_x(axes, _drawing.ORDER_LABEL)
        _drawing.legend_above(axes[0], gap=gap)
        return axes[0] if isinstance(self.channel, str) else axes

    def _draw_line(self, panel: Any, values: NDArray[np.floating], label: str, number: int) -> None:
        top = self.orders[-1] if self.max_order is None else self.max_order
        # Detrending changes the line at order 0, which is not the order of any fault.
        drawn = (self.orders > 0) & (self.orders <= top)
        power = self._scaled(values[drawn])
        if not np.all(np.isnan(power)):
            style = {"label": _drawing.wrapped(label), **_drawing.line_style(number)}
            if len(self.spectra) == 1:
                style["linestyle"] = "-"
            panel.plot(self.orders[drawn], power, linewidth=1.2, **style)
