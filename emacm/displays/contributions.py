"""Pictures of which orders carried a decision, beside the orders that faults are expected at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from emacm.displays._bars import bin_blocks, bin_panels, bin_places, draw_bars, mark_panels
from emacm.displays._drawing import (
    COLOURS,
    legend_beside,
    name_side,
    tint,
    wrapped,
)
from emacm.displays._tables import (
    check_fault_orders,
    check_values,
)
from emacm.orders.columns import number_name

_COLUMNS = ("channel", "low", "high", "contribution")


class ContributionsDisplay:
    """Contribution of each order bin to a decision, one panel for each channel.

    Parameters
    ----------
    columns : sequence of str or of (low, high)
        Names ``channel@low-high`` or ``channel@name``, as `BinTransformer` writes them; or the
        edges [orders] of the bins of one channel.
    contributions : array-like of shape (n_columns,)
        Contribution of each, signed: what speaks for the decision is positive.
    fault_orders : mapping of str to float, optional
        Orders at which faults are expected, by name. Those beyond the bins are passed over.
    decision : str
        What the contributions speak for or against.
    unit : str
        Their unit, such as "nats" for logarithms of odds.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (n_channels,)
        What was drawn on, once `plot` has run.
    figure_ : Figure
        The figure of `ax_`.

    Raises
    ------
    TypeError, ValueError
        If columns are neither names nor bands, or contributions do not fit them or are not
        finite.

    Examples
    --------
    >>> display = ContributionsDisplay([(0, 1), (3, 4)], [-0.5, 2.0], fault_orders={"screw": 3.125})
    >>> display.frame().to_numpy().tolist()
    [['signal', '0-1', -0.5, ''], ['signal', '3-4', 2.0, 'screw']]
    """

    ax_: Any
    figure_: Any

    def __init__(
        self,
        columns: Sequence[Any],
        contributions: ArrayLike,
        *,
        fault_orders: Mapping[str, float] | None = None,
        decision: str = "the decision",
        unit: str = "nats",
    ) -> None:
        self.blocks = bin_blocks(columns)
        n_columns = sum(len(block.names) for block in self.blocks)
        self.contributions = check_values(contributions, "contributions", (n_columns,))
        self.fault_orders = check_fault_orders(fault_orders)
        self.decision = decision
        self.unit = unit

    @classmethod
    def from_table(
        cls,
        table: pd.DataFrame,
        *,
        fault_orders: Mapping[str, float] | None = None,
        decision: str = "the decision",
        unit: str = "nats",
        ax: Any = None,
    ) -> ContributionsDisplay:
        """Draw a table of contributions.

        Parameters
        ----------
        table : DataFrame
            A row a bin, with columns "channel", "low", "high" [orders] and "contribution".
        fault_orders, decision, unit
            As for the class.
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one for each channel.

        Returns
        -------
        ContributionsDisplay

        Raises
        ------
        TypeError, ValueError
            If a column is not there, or holds what it should not.
        """
        missing = [name for name in _COLUMNS if name not in getattr(table, "columns", ())]
        if missing:
            raise ValueError(f"table must have the columns {list(_COLUMNS)}; it lacks {missing}.")
        edges = check_values(table[["low", "high"]], "low and high", (None, 2), least=0)
        falling = np.flatnonzero(edges[:, 0] >= edges[:, 1])
        if len(falling):
            raise ValueError(
                f"low must be below high, got {edges[falling[0]].tolist()} in row {falling[0]}."
            )
        names = [
            f"{channel}@{number_name(low)}-{number_name(high)}"
            for channel, (low, high) in zip(table["channel"], edges, strict=True)
        ]
        display = cls(
            names, table["contribution"], fault_orders=fault_orders, decision=decision, unit=unit
        )
        return display.plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the numbers: a row a bin, and the names of the fault orders within it."""
        rows = [
            (block.channel, name, self.contributions[column], self._faults_within(band))
            for block in self.blocks
            for name, band, column in zip(
                block.names, _bands(block), block.columns.tolist(), strict=True
            )
        ]
        return pd.DataFrame(rows, columns=["channel", "bin", "contribution", "fault_orders"])

    def plot(self, *, ax: Any = None) -> ContributionsDisplay:
        """Draw a bar for each bin: up what speaks for the decision, down what speaks against it.

        Parameters
        ----------
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one for each channel. Default: a new figure.

        Returns
        -------
        ContributionsDisplay
            Itself.
        """
        axes = bin_panels(ax, self.blocks)
        limits = 1.08 * np.abs(self.contributions).max() or 1.0
        for panel, block in zip(axes, self.blocks, strict=True):
            values = self.contributions[block.columns]
            for colour, hatch, word, chosen in (
                (COLOURS[1], "", "for", values >= 0),
                (tint(COLOURS[5], 0.6), "////", "against", values < 0),
            ):
                label = wrapped(f"speaks {word} {self.decision}")
                places = bin_places(block)[chosen]
                bars = values[chosen]
                draw_bars(panel, places, bars, color=colour, hatch=hatch, label=label)
            panel.axhline(0, color="black", linewidth=0.6)
            panel.set_ylim(-limits, limits)  # alike in all channels, to be compared
            name_side(panel, f"contribution of {block.channel}", self.unit)
        mark_panels(axes, self.blocks, self.fault_orders)
        legend_beside(axes[0])
        self.ax_, self.figure_ = axes, axes[0].figure
        return self

    def _faults_within(self, band: Any) -> str:
        if band is None:
            return ""
        low, high = band
        return ", ".join(name for name, order in self.fault_orders.items() if low <= order < high)


def _bands(block: Any) -> Sequence[Any]:
    return [None] * len(block.names) if block.bands is None else list(block.bands)
