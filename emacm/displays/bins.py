"""Order bins: the power in each bin, between its exact edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import InitVar, dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from emacm.displays import _bars, _drawing, _tables
from emacm.displays._display import PowerDisplay, bar_style
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.bins import check_stop_bands
from emacm.orders.columns import BinBlock, column_names


@dataclass(eq=False, repr=False)
class OrderBinsDisplay(PowerDisplay):
    """Power in order bins, one panel for each channel.

    One group of recordings is drawn as bars, several as one stepped line each. Bins that overlap
    are drawn side by side, under their names.

    Parameters
    ----------
    columns : sequence of str or of (low, high)
        Names ``channel@low-high`` or ``channel@name``, as written by `BinTransformer`; or the
        edges [orders] of the bins of one channel.
    powers : mapping of str to ndarray of shape (n_columns,)
        Mean square in each bin [unit²], by label.
    stop_bands : sequence of (low, high)
        Orders that were removed; hatched.
    unit, envelopes, fault_orders, slip, healthy
        As for `OrderSpectrumDisplay`. Fault orders outside of the bins are not drawn.
    scale : {"dB", "linear"}
        Scale of the power. In dB nothing is drawn where it is 0.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (n_channels,)
        Set when the display is drawn.
    figure_ : Figure
        Figure of these Axes.

    Raises
    ------
    TypeError, ValueError
        If columns are neither names nor bands, powers do not fit them, are negative or not
        finite, or an option is invalid.

    Notes
    -----
    Source of this kind of figure: Chirico, Fig. 3.5.

    Examples
    --------
    >>> display = OrderBinsDisplay([(0, 1), (1, 2)], {"healthy": [0.5, 2.0]})
    >>> display.frame()["healthy"].to_dict()
    {('signal', '0-1'): 0.5, ('signal', '1-2'): 2.0}
    """

    _step = BinTransformer
    _from_step = ("stop_bands",)

    columns: InitVar[Sequence[Any]]
    powers: Any
    stop_bands: Any = field(default=(), kw_only=True)

    def __post_init__(self, columns: Sequence[Any]) -> None:
        super().__post_init__()
        self.blocks = _bars.bin_blocks(columns)
        shape = (sum(len(block.names) for block in self.blocks),)
        self.powers = {
            str(label): _tables.check_values(values, f"powers of {label!r}", shape, least=0)
            for label, values in self.powers.items()
        }
        if not self.powers:
            raise ValueError("powers hold no group; at least one is needed.")
        self.stop_bands = check_stop_bands(self.stop_bands)

    @classmethod
    def from_table(
        cls,
        table: Any,
        channel: str | Sequence[str] | None = None,
        *,
        labels: ArrayLike | None = None,
        ax: Any = None,
        **options: Any,
    ) -> OrderBinsDisplay:
        """Draw the mean bins of the recordings of each label.

        Parameters
        ----------
        table : DataFrame of shape (n_recordings, n_columns)
            Result of `BinTransformer` under ``set_output(transform="pandas")``.
        channel : str or sequence of str, optional
            Channels to draw, as in the column names. Default: all.
        labels : array-like of shape (n_recordings,), optional
            Label of each recording. Default: the mean of all, as bars.
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one Axes for each channel.
        **options
            As for the class: stop_bands, unit, envelopes, fault_orders, slip, healthy, scale.

        Returns
        -------
        OrderBinsDisplay

        Raises
        ------
        TypeError, ValueError
            If the table has no column names or no such channel, labels do not fit it, or an
            option is invalid.
        """
        names = column_names(table)
        blocks = _tables.channel_blocks(None if names is None else _bars.bin_blocks(names), channel)
        chosen = np.concatenate([block.columns for block in blocks])
        means = _tables.means_by_label(np.asarray(table)[:, chosen], labels, "all recordings")
        return cls([(names or ())[i] for i in chosen], means, **options).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the powers: one row per channel and bin, one column per label."""
        return _bars.bin_frame(self.blocks, self.powers)

    def _draw(self, ax: Any) -> Any:
        axes = _bars.bin_panels(ax, self.blocks)
        for panel, block in zip(axes, self.blocks, strict=True):
            if _bars.has_order_axis(block):
                _bars.draw_stop_bands(panel, self.stop_bands)
            self._draw_block(panel, block)
            self._label_power(panel, block.channel, "power")
        _drawing.legend_above(axes[0], gap=_bars.mark_panels(axes, self.blocks, self.fault_orders))
        return axes

    def _draw_block(self, panel: Any, block: BinBlock) -> None:
        places = _bars.bin_places(block)
        numbers = _drawing.state_numbers(self.powers, self.healthy)
        groups = {label: self._scaled(self.powers[label][block.columns]) for label in numbers}
        if len(groups) > 1:
            for label, values in groups.items():
                style = _drawing.line_style(numbers[label])
                _bars.draw_steps(panel, places, values, label=_drawing.wrapped(label), **style)
            return
        ((label, values),) = groups.items()
        style = {**bar_style(_drawing.colour_of(numbers[label])), "label": _drawing.wrapped(label)}
        known = values[np.isfinite(values)]
        if self.scale == "linear" or not len(known):
            _bars.draw_bars(panel, places, values, **style)
            return
        # Decibel bars have no natural zero; start below the minimum.
        margin = max(1.0, 0.08 * float(np.ptp(known)))
        bottom = float(known.min()) - margin
        _bars.draw_bars(panel, places, values, bottom=bottom, **style)
        panel.set_ylim(bottom, known.max() + margin)
