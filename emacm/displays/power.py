"""Power over the order: order spectra and order bins, by group of recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import InitVar, dataclass, field
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.utils import check_consistent_length

from emacm.decisions.pipelines import parts_with_input
from emacm.displays import bars, drawing, drawn_values
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.bins import check_stop_bands
from emacm.orders.columns import column_names, parse_bin_columns, parse_order_columns
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.inputs import check_channel_names


@dataclass(eq=False, repr=False, kw_only=True)
class PowerDisplay(drawn_values.OrderDisplay):
    """Power over the order, by group of recordings and channel.

    Subclasses state the pipeline step of `from_estimator` and the parameters taken from it.
    """

    _step: ClassVar[type]
    _from_step: ClassVar[tuple[str, ...]]
    _parse: ClassVar[Any]  # parser of the column names
    _of_means: ClassVar[Any]  # constructor from means by label, and the blocks of channels

    unit: str | Mapping[str, str] = "unit"
    envelopes: Mapping[str, str] = field(default_factory=dict)
    healthy: Any = drawing.HEALTHY

    @classmethod
    def from_table(
        cls,
        table: Any,
        channel: str | Sequence[str] | None = None,
        *,
        labels: ArrayLike | None = None,
        ax: Any = None,
        **options: Any,
    ) -> Self:
        """Draw the mean of the recordings of each label.

        Parameters
        ----------
        table : OrderTable or DataFrame of shape (n_recordings, n_columns)
            Result of `OrderPSD`, or of `BinTransformer` under ``set_output(transform="pandas")``.
        channel : str or sequence of str, optional
            Channels to draw, as in the column names. Default: all.
        labels : array-like of shape (n_recordings,), optional
            Label of each recording. Default: the mean of all.
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one Axes for each channel.
        **options
            As for the class.

        Returns
        -------
        OrderSpectrumDisplay or OrderBinsDisplay

        Raises
        ------
        TypeError, ValueError
            If the table has no order axis or no such channel, labels do not fit it, or an option
            is invalid.
        """
        blocks = _channel_blocks(cls._parse(column_names(table) or ()), channel)
        single = channel if isinstance(channel, str) else None
        means = _means_by_label(table, labels, single or "all recordings")
        return cls._of_means(means, blocks, single, **options).plot(ax=ax)

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: Any, channel: str | Sequence[str] | None = None, **options: Any
    ) -> Self:
        """Transform recordings by a fitted pipeline, and draw the mean of each label.

        Parameters
        ----------
        estimator : OrderPSD, BinTransformer, or Pipeline or search with such a step
            Fitted. Steps after the first one that is drawn are not used. Envelope channels,
            `scaling` and `stop_bands` are taken from the steps, units from the first recording.
        X : list of Recording
            Recordings, or the input of the first step.
        channel : str or sequence of str, optional
            Channels to draw, as in the column names. Default: all.
        **options
            As for `from_table`: labels, ax, and as for the class.

        Returns
        -------
        OrderSpectrumDisplay or OrderBinsDisplay

        Raises
        ------
        TypeError, ValueError
            If the pipeline has no such step, and as for `from_table`.
        """
        step, own = next(parts_with_input(estimator, X, cls._step), (None, None))
        if step is None:
            raise ValueError(f"estimator must be or contain {cls._step.__name__}; got {estimator}.")
        values = np.asarray(step.transform(own))
        table = pd.DataFrame(values, columns=step.get_feature_names_out())
        known = {option: getattr(step, option) for option in cls._from_step}
        known["envelopes"] = drawn_values.envelopes_of(estimator)
        known["unit"] = getattr(next(iter(X), None), "units", None) or "unit"
        return cls.from_table(table, channel, **(known | options))

    def _label_power(self, panel: Any, channel: str, quantity: str, per: str = "") -> None:
        """Label the y axis with quantity, channel and unit."""
        words, unit = drawn_values.quantity_of(quantity, channel, self.unit, self.envelopes)
        drawing.label_y(panel, words, f"dB re 1 {drawing.squared(unit)}{per}")


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
    _parse = staticmethod(parse_order_columns)

    orders: Any
    spectra: Any
    channel: Any = field(default="signal", kw_only=True)
    max_order: float | None = field(default=None, kw_only=True)
    scaling: str = field(default="density", kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.orders = drawn_values.check_values(self.orders, "orders", (None,), least=0)
        self.channels = [self.channel] if isinstance(self.channel, str) else list(self.channel)
        shape = (len(self.channels), len(self.orders))
        self.spectra = {
            str(label): drawn_values.check_values(
                np.atleast_2d(values), f"the spectrum of {label!r}", shape, least=0
            )
            for label, values in self.spectra.items()
        }

    @classmethod
    def _of_means(cls, means: Any, blocks: Any, single: str | None, **options: Any) -> Self:
        for block in blocks:
            if not np.array_equal(block.orders, blocks[0].orders):
                raise ValueError(
                    f"channels {blocks[0].channel!r} and {block.channel!r} have different orders; "
                    f"draw each in a display of its own."
                )
        spectra = {label: [mean[b.columns] for b in blocks] for label, mean in means.items()}
        channel = single or [block.channel for block in blocks]
        return cls(blocks[0].orders, spectra, channel=channel, **options)

    def frame(self) -> pd.DataFrame:
        """Return the spectra: one row per order, one column per label (or channel and label)."""
        columns = {
            (channel, label): values[i]
            for i, channel in enumerate(self.channels)
            for label, values in self.spectra.items()
        }
        table = pd.DataFrame(columns, index=pd.Index(self.orders, name="order"))
        table.columns.names = ["channel", "label"]
        return table[self.channel] if isinstance(self.channel, str) else table

    def _draw(self, ax: Any) -> Any:
        n_channels = len(self.channels)
        axes = drawing.panel_axes(ax, n_channels, height=3.8 if n_channels == 1 else 2.0)
        top = self.orders[-1] if self.max_order is None else self.max_order
        # Detrending changes the line at order 0, which is not the order of any fault.
        drawn = (self.orders > 0) & (self.orders <= top)
        gap = 0.0
        for i, (panel, channel) in enumerate(zip(axes, self.channels, strict=True)):
            for label, number in drawing.state_numbers(self.spectra, self.healthy).items():
                style = {"label": drawing.wrapped(label), **drawing.line_style(number)}
                if len(self.spectra) == 1:
                    style["linestyle"] = "-"
                power = drawing.decibels(self.spectra[label][i][drawn])
                panel.plot(self.orders[drawn], power, linewidth=1.2, **style)
            panel.set_xlim(0, top)
            density = self.scaling == "density"
            self._label_power(panel, channel, *(("PSD", "/order") if density else ("power",)))
            gap = max(gap, drawing.mark_orders(panel, self.fault_orders, named=i == 0))
        drawing.label_x(axes, drawing.ORDER_LABEL)
        drawing.legend_above(axes[0], gap=gap)
        return axes[0] if isinstance(self.channel, str) else axes


@dataclass(eq=False, repr=False)
class OrderBinsDisplay(PowerDisplay):
    """Power in order bins, a stepped line for each group of recordings, a panel for each channel.

    Bins without edges in their names, ``channel@name``, are drawn side by side.

    Parameters
    ----------
    columns : sequence of str
        Names ``channel@low-high`` or ``channel@name``, as written by `BinTransformer`.
    powers : mapping of str to ndarray of shape (n_columns,)
        Mean square in each bin [unit²], by label.
    stop_bands : sequence of (low, high)
        Orders that were removed; hatched.
    unit, envelopes, fault_orders, slip, healthy
        As for `OrderSpectrumDisplay`. Fault orders outside of the bins are not drawn.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (n_channels,)
        Set when the display is drawn.
    figure_ : Figure
        Figure of these Axes.

    Raises
    ------
    TypeError, ValueError
        If powers do not fit the columns, are negative or not
        finite, or an option is invalid.

    Notes
    -----
    Source of this kind of figure: Chirico, Fig. 3.5.

    Examples
    --------
    >>> display = OrderBinsDisplay(["torque@0-1", "torque@1-2"], {"healthy": [0.5, 2.0]})
    >>> display.frame()["healthy"].to_dict()
    {('torque', '0-1'): 0.5, ('torque', '1-2'): 2.0}
    """

    _step = BinTransformer
    _from_step = ("stop_bands",)
    _parse = staticmethod(parse_bin_columns)

    columns: InitVar[Sequence[Any]]
    powers: Any
    stop_bands: Any = field(default=(), kw_only=True)

    def __post_init__(self, columns: Sequence[Any]) -> None:
        super().__post_init__()
        self.blocks = bars.bin_blocks(columns)
        shape = (sum(len(block.names) for block in self.blocks),)
        self.powers = {
            str(label): drawn_values.check_values(values, f"powers of {label!r}", shape, least=0)
            for label, values in self.powers.items()
        }
        self.stop_bands = check_stop_bands(self.stop_bands)

    @classmethod
    def _of_means(cls, means: Any, blocks: Any, single: str | None, **options: Any) -> Self:
        names = [f"{block.channel}@{name}" for block in blocks for name in block.names]
        columns = np.concatenate([block.columns for block in blocks])
        return cls(names, {label: mean[columns] for label, mean in means.items()}, **options)

    def frame(self) -> pd.DataFrame:
        """Return the powers: one row per channel and bin, one column per label."""
        return bars.bin_frame(self.blocks, self.powers)

    def _draw(self, ax: Any) -> Any:
        axes = bars.bin_panels(ax, self.blocks)
        for panel, block in zip(axes, self.blocks, strict=True):
            for label, number in drawing.state_numbers(self.powers, self.healthy).items():
                levels = drawing.decibels(self.powers[label][block.columns])
                alone = {"linestyle": "-"} if len(self.powers) == 1 else {}
                bars.draw_steps(panel, bars.bin_places(block), levels, label, number, **alone)
            if block.bands is not None:
                bars.draw_stop_bands(panel, self.stop_bands)  # last in the legend
            self._label_power(panel, block.channel, "power")
        drawing.legend_above(axes[0], gap=bars.mark_panels(axes, self.blocks, self.fault_orders))
        return axes


def _channel_blocks(blocks: Sequence[Any] | None, channel: str | Sequence[str] | None) -> list[Any]:
    """Choose the columns of one channel, of several, or of all.

    Parameters
    ----------
    blocks : sequence of OrderBlock or BinBlock, or None
        Columns of each channel, read from their names; None if names have another form.
    channel : str, sequence of str or None
        Channels to choose; None for all.

    Returns
    -------
    list of OrderBlock or BinBlock

    Raises
    ------
    ValueError
        If there is no order axis, or no such channel.
    """
    if blocks is None:
        raise ValueError(
            "the table has no order axis; pass the result of OrderPSD (or of BinTransformer under "
            "set_output(transform='pandas')) with its column names, or use from_estimator."
        )
    known = {block.channel: block for block in blocks}
    wanted = [channel] if isinstance(channel, str) else list(known if channel is None else channel)
    check_channel_names(list(known), wanted, "the table")
    return [known[name] for name in wanted]


def _means_by_label(
    values: ArrayLike, labels: ArrayLike | None, otherwise: str
) -> dict[str, NDArray[np.floating]]:
    """Average the recordings of each label; without labels, all under the name `otherwise`.

    Raises
    ------
    ValueError
        If a value is not finite, or the number of labels differs.
    """
    table = drawn_values.check_values(values, "the table", (None, None))
    groups = np.asarray([otherwise] * len(table) if labels is None else labels)
    check_consistent_length(table, groups)
    means = pd.DataFrame(table).groupby(groups, dropna=False).mean()
    return dict(zip(means.index.map(str), means.to_numpy(), strict=True))
