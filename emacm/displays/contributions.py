"""Contributions of order bins to a decision."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import InitVar, dataclass, field
from typing import Any

import pandas as pd

from emacm.displays import bars, drawing, drawn_values
from emacm.displays.drawn_values import OrderDisplay


@dataclass(eq=False, repr=False)
class ContributionsDisplay(OrderDisplay):
    """Contribution of each order bin to a decision, one panel for each channel.

    Parameters
    ----------
    columns : sequence of str
        Names ``channel@low-high`` or ``channel@name``, as written by `BinTransformer`.
    contributions : array-like of shape (n_columns,)
        Contribution of each bin [nats], signed: positive values are evidence for the decision.
    fault_orders : DataFrame of `emacm.fault_orders`, or mapping of str to float, optional
        Predicted fault orders, which are marked. Those outside of the bins are not drawn.
    slip : float
        Largest relative slip: a line that slips may be lower or higher by this fraction of its
        order, and this range is shaded. In a mapping every order may slip.
    decision : str
        The decision that is explained.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (n_channels,)
        Set when the display is drawn.
    figure_ : Figure
        Figure of these Axes.

    Raises
    ------
    TypeError, ValueError
        If contributions do not fit the columns or are not finite, or an option is invalid.

    Examples
    --------
    >>> names = ["torque@0-1", "torque@3-4"]
    >>> display = ContributionsDisplay(names, [-0.5, 2.0], fault_orders={"screw": 3.125})
    >>> display.frame()["contribution"].to_dict()
    {('torque', '0-1'): -0.5, ('torque', '3-4'): 2.0}
    """

    columns: InitVar[Sequence[Any]]
    contributions: Any
    decision: str = field(default="the decision", kw_only=True)

    def __post_init__(self, columns: Sequence[Any]) -> None:
        super().__post_init__()
        self.blocks = bars.bin_blocks(columns)
        shape = (sum(len(block.names) for block in self.blocks),)
        self.contributions = drawn_values.check_values(self.contributions, "contributions", shape)

    @classmethod
    def from_table(
        cls, table: pd.DataFrame, *, ax: Any = None, **options: Any
    ) -> ContributionsDisplay:
        """Draw a table of contributions.

        Parameters
        ----------
        table : DataFrame
            Result of `explain_decision` or `explain_model`: one row per bin, with columns
            "column" (its name) and "contribution".
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one Axes for each channel.
        **options
            As for the class: fault_orders, slip, decision.

        Returns
        -------
        ContributionsDisplay

        Raises
        ------
        TypeError, ValueError
            If a value or an option is invalid.
        """
        return cls(table["column"], table["contribution"], **options).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the contributions, one row per channel and bin."""
        return bars.bin_frame(self.blocks, {"contribution": self.contributions})

    def _draw(self, ax: Any) -> Any:
        axes = bars.bin_panels(ax, self.blocks)
        low, high = min(0, self.contributions.min()), max(0, self.contributions.max())
        margin = 0.08 * (high - low)
        limits = (low - margin, high + margin) if margin else (-1, 1)
        for panel, block in zip(axes, self.blocks, strict=True):
            values = self.contributions[block.columns]
            for colour, hatch, word, shown in (
                (drawing.COLOURS[2], "", "for", values >= 0),
                (drawing.COLOURS[4], "////", "against", values < 0),
            ):
                low, high = bars.bin_places(block)[shown].T
                style = {"color": drawing.tint(colour, 0.6), "edgecolor": "black", "hatch": hatch}
                panel.bar(low, values[shown], high - low, align="edge", linewidth=0.5, **style)
                if panel is axes[0]:
                    label = drawing.wrapped(f"evidence {word} {self.decision}")
                    panel.fill_between([], [], label=label, linewidth=0.5, **style)
            panel.axhline(0, color="black", linewidth=0.6)
            panel.set_ylim(limits)  # equal in all channels, for comparison
            drawing.label_y(panel, f"contribution of {block.channel}", "nats")
        drawing.legend_above(axes[0], gap=bars.mark_panels(axes, self.blocks, self.fault_orders))
        return axes
