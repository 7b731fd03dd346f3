"""Pictures of order bins: the power in each, between its exact edges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_choice
from emacm.displays._bars import (
    bin_blocks,
    bin_panels,
    bin_places,
    draw_bars,
    draw_steps,
    draw_stop_bands,
    mark_panels,
)
from emacm.displays._drawing import (
    COLOURS,
    decibels,
    legend_beside,
    line_style,
    name_side,
    squared,
    tint,
    wrapped,
)
from emacm.displays._tables import (
    channel_blocks,
    check_fault_orders,
    check_values,
    means_by_label,
    pipeline_until,
    unit_of,
)
from emacm.displays.spectrum import SCALES
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.bins import Band, check_stop_bands
from emacm.orders.columns import BinBlock, column_names


class OrderBinsDisplay:
    """Power in order bins, one panel for each channel.

    One group of recordings is drawn as bars, several as a line of steps each.

    Parameters
    ----------
    columns : sequence of str or of (low, high)
        Names ``channel@low-high`` or ``channel@name``, as `BinTransformer` writes them; or the
        edges [orders] of the bins of one channel.
    powers : mapping of str to ndarray of shape (n_columns,)
        Mean square in each bin [unit²], by label.
    stop_bands : sequence of (low, high)
        Orders that were taken out; hatched.
    unit : str or mapping of str to str
        Unit of the channel, or of each.
    fault_orders : mapping of str to float, optional
        Orders to be marked, by name. Those beyond the bins are passed over.
    scale : {"dB", "linear"}
        Scale of the power. In dB nothing is drawn where it is 0.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (n_channels,)
        What was drawn on, once `plot` has run.
    figure_ : Figure
        The figure of `ax_`.

    Raises
    ------
    TypeError, ValueError
        If columns are neither names nor bands, or powers do not fit them, are negative or
        not finite.

    Notes
    -----
    Source of such pictures: Chirico, Fig. 3.5.

    Examples
    --------
    >>> display = OrderBinsDisplay([(0, 1), (1, 2)], {"healthy": [0.5, 2.0]})
    >>> display.frame()["healthy"].to_dict()
    {('signal', '0-1'): 0.5, ('signal', '1-2'): 2.0}
    """

    ax_: Any
    figure_: Any

    def __init__(
        self,
        columns: Sequence[Any],
        powers: Mapping[str, ArrayLike],
        *,
        stop_bands: Sequence[Band] = (),
        unit: str | Mapping[str, str] = "unit",
        fault_orders: Mapping[str, float] | None = None,
        scale: str = "dB",
    ) -> None:
        self.blocks = bin_blocks(columns)
        shape = (sum(len(block.names) for block in self.blocks),)
        self.powers = {
            str(label): check_values(values, f"powers of {label!r}", shape, least=0)
            for label, values in powers.items()
        }
        if not self.powers:
            raise ValueError("powers hold no group; at least one is needed.")
        self.stop_bands = check_stop_bands(stop_bands)
        self.unit = unit
        self.fault_orders = check_fault_orders(fault_orders)
        self.scale = check_choice(scale, "scale", SCALES)

    @classmethod
    def from_table(
        cls,
        bins: Any,
        channel: str | Sequence[str] | None = None,
        *,
        labels: ArrayLike | None = None,
        stop_bands: Sequence[Band] = (),
        unit: str | Mapping[str, str] = "unit",
        fault_orders: Mapping[str, float] | None = None,
        scale: str = "dB",
        ax: Any = None,
    ) -> OrderBinsDisplay:
        """Draw the mean bins of the recordings of each label.

        Parameters
        ----------
        bins : DataFrame of shape (n_recordings, n_columns)
            What `BinTransformer` returns under ``set_output(transform="pandas")``.
        channel : str or sequence of str, optional
            Which channels to draw, as in its column names. Default: all.
        labels : array-like of shape (n_recordings,), optional
            Label of each recording. Default: bars for all.
        stop_bands, unit, fault_orders, scale
            As for the class.
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one for each channel.

        Returns
        -------
        OrderBinsDisplay

        Raises
        ------
        TypeError, ValueError
            If the table has no names of columns or no such channel, or labels do not fit it.
        """
        names = column_names(bins)
        if names is None:
            raise ValueError(
                "bins carry no names; pass a DataFrame, as BinTransformer returns under "
                "set_output(transform='pandas'), or use from_estimator."
            )
        values = pd.DataFrame(np.asarray(bins), columns=list(names))
        blocks = channel_blocks(bin_blocks(names), channel, remedy="pass names of columns")
        chosen = values.iloc[:, np.concatenate([block.columns for block in blocks])]
        display = cls(
            list(chosen.columns),
            means_by_label(chosen, labels, "all recordings"),
            stop_bands=stop_bands,
            unit=unit,
            fault_orders=fault_orders,
            scale=scale,
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
        fault_orders: Mapping[str, float] | None = None,
        scale: str = "dB",
        ax: Any = None,
    ) -> OrderBinsDisplay:
        """Gather the spectra of recordings into bins by a fitted pipeline, and draw them.

        Parameters
        ----------
        estimator : BinTransformer, or Pipeline with such a step
            Fitted. What comes after the bins has no say; stop bands are its own.
        X : list of Recording
            Recordings, or whatever the first step takes.
        channel, labels, unit, fault_orders, scale, ax
            As for `from_table`.

        Returns
        -------
        OrderBinsDisplay

        Raises
        ------
        ValueError
            If there is no `BinTransformer`, and as for `from_table`.
        """
        step, before = pipeline_until(
            estimator, lambda s: isinstance(s, BinTransformer), "a BinTransformer"
        )
        powers = step.transform(X if before is None else before.transform(X))
        bins = pd.DataFrame(np.asarray(powers), columns=step.get_feature_names_out())
        return cls.from_table(
            bins,
            channel,
            labels=labels,
            stop_bands=step.stop_bands,
            unit=unit,
            fault_orders=fault_orders,
            scale=scale,
            ax=ax,
        )

    def frame(self) -> pd.DataFrame:
        """Return the numbers: a row a channel and bin, a column a label."""
        rows = [(block.channel, name) for block in self.blocks for name in block.names]
        places = np.concatenate([block.columns for block in self.blocks])
        index = pd.MultiIndex.from_tuples(rows, names=["channel", "bin"])
        columns = {label: values[places] for label, values in self.powers.items()}
        return pd.DataFrame(columns, index=index)

    def plot(self, *, ax: Any = None) -> OrderBinsDisplay:
        """Draw the power in each bin against the order.

        Parameters
        ----------
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one for each channel. Default: a new figure.

        Returns
        -------
        OrderBinsDisplay
            Itself.
        """
        axes = bin_panels(ax, self.blocks)
        for panel, block in zip(axes, self.blocks, strict=True):
            if block.bands is not None:
                draw_stop_bands(panel, self.stop_bands)
            self._draw_block(panel, block)
            unit = squared(unit_of(self.unit, block.channel))
            reference = "dB re 1 " if self.scale == "dB" else ""
            name_side(panel, f"power of {block.channel}", f"{reference}{unit}")
        mark_panels(axes, self.blocks, self.fault_orders)
        legend_beside(axes[0])
        self.ax_, self.figure_ = axes, axes[0].figure
        return self

    def _draw_block(self, panel: Any, block: BinBlock) -> None:
        places = bin_places(block)
        groups = {
            label: self._scaled(values[block.columns]) for label, values in self.powers.items()
        }
        if len(groups) > 1:
            for number, (label, values) in enumerate(groups.items()):
                draw_steps(panel, places, values, label=wrapped(label), **line_style(number))
            return
        ((label, values),) = groups.items()
        style: dict[str, Any] = {"color": tint(COLOURS[0], 0.6), "label": wrapped(label)}
        known = values[np.isfinite(values)]
        if self.scale == "linear" or not len(known):
            draw_bars(panel, places, values, **style)
            return
        # No bar of dB has a natural foot; this one leaves the lowest to be seen.
        margin = max(1.0, 0.08 * float(np.ptp(known)))
        bottom = float(known.min()) - margin
        draw_bars(panel, places, values, bottom=bottom, **style)
        panel.set_ylim(bottom, known.max() + margin)

    def _scaled(self, values: NDArray[np.floating]) -> NDArray[np.floating]:
        return decibels(values) if self.scale == "dB" else values
