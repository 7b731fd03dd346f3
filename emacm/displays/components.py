"""What order bins matter for: principal components, and contributions to a decision."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import InitVar, dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from emacm.displays import _bars, _drawing, _tables
from emacm.displays._bars import bar_style
from emacm.displays._drawing import Display
from emacm.displays._tables import OrderDisplay
from emacm.orders.columns import BinBlock


@dataclass(eq=False, repr=False)
class ExplainedVarianceDisplay(Display):
    """Fraction of the variance that each principal component explains.

    Parameters
    ----------
    shares : array-like of shape (n_components,)
        Fraction for each component, from 0 to 1.
    n_shown : int
        Highest number of components to draw.

    Attributes
    ----------
    ax_, figure_
        Axes and figure, set when the display is drawn.

    Notes
    -----
    Source of this kind of figure: Chirico, Fig. 3.6.

    Examples
    --------
    >>> ExplainedVarianceDisplay([0.75, 0.25]).frame()["cumulative"].to_dict()
    {1: 0.75, 2: 1.0}
    """

    shares: Any
    n_shown: int = field(default=20, kw_only=True)

    @classmethod
    def from_estimator(
        cls, estimator: Any, *, ax: Any = None, **options: Any
    ) -> ExplainedVarianceDisplay:
        """Draw the shares of a fitted principal component analysis.

        Parameters
        ----------
        estimator : PCA, or Pipeline with such a step
            Fitted; anything with `explained_variance_ratio_`.
        ax : matplotlib Axes, optional
            Where to draw.
        **options
            As for the class: n_shown.

        Returns
        -------
        ExplainedVarianceDisplay

        Raises
        ------
        ValueError
            If there is no such step.
        """
        step, _ = _components_of(estimator)
        return cls(step.explained_variance_ratio_, **options).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the shares and their cumulative sum, one row per component."""
        index = pd.RangeIndex(1, len(self.shares) + 1, name="component")
        columns = {"share": self.shares, "cumulative": np.cumsum(self.shares)}
        return pd.DataFrame(columns, index=index)

    def _draw(self, ax: Any) -> Any:
        (ax,) = _drawing.panel_axes(ax, height=2.8)
        table = 100 * self.frame().iloc[: self.n_shown]
        ax.bar(table.index, table["share"], label="each component", **bar_style(_drawing.PLAIN))
        style = {"color": _drawing.COLOURS[1], "markersize": 4, "label": "cumulative sum"}
        ax.plot(table.index, table["cumulative"], "s--", **style)
        ax.set(xlabel="principal component", ylabel="share of the variance [%]")
        ax.set(xlim=(0.3, len(table) + 0.7), ylim=(0, 105))
        ax.xaxis.get_major_locator().set_params(integer=True)
        _drawing.legend_above(ax)
        return ax


def _components_of(estimator: Any) -> tuple[Any, Any]:
    """Return a fitted principal component analysis, and the steps before it."""
    return _tables.pipeline_until(
        estimator, lambda s: hasattr(s, "explained_variance_ratio_"), "a fitted PCA"
    )


@dataclass(eq=False, repr=False)
class LoadingsDisplay(Display):
    """Weight of each order bin in the principal components, one panel for each component.

    Each channel is a stepped line.

    Parameters
    ----------
    columns : sequence of str
        Names ``channel@low-high`` or ``channel@name``, as written by `BinTransformer`.
    loadings : array-like of shape (n_components, n_columns)
        Components of the eigenvectors, signed, without unit.
    titles : sequence of str, optional
        Names of the components. Default: "component 1" and so on.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (n_components,)
        Set when the display is drawn.
    figure_ : Figure
        Figure of these Axes.

    Raises
    ------
    TypeError, ValueError
        If loadings do not fit the columns, or are not finite.

    Notes
    -----
    Source of this kind of figure: Chirico, Fig. 3.7, which shows magnitudes. The sign of a whole
    component is arbitrary; signs within it show which bins increase together.

    Examples
    --------
    >>> display = LoadingsDisplay(["current@0-1", "current@1-2"], [[0.6, -0.8]])
    >>> display.frame()["component 1"].to_dict()
    {('current', '0-1'): 0.6, ('current', '1-2'): -0.8}
    """

    columns: InitVar[Sequence[Any]]
    loadings: Any
    titles: Any = field(default=None, kw_only=True)

    def __post_init__(self, columns: Sequence[Any]) -> None:
        self.blocks = _bars.bin_blocks(columns)
        n_columns = sum(len(block.names) for block in self.blocks)
        self.loadings = _tables.check_values(self.loadings, "loadings", (None, n_columns))
        if self.titles is None:
            self.titles = [f"component {i + 1}" for i in range(len(self.loadings))]

    @classmethod
    def from_estimator(
        cls, estimator: Any, *, n_components: int = 2, ax: Any = None
    ) -> LoadingsDisplay:
        """Draw the first components of a fitted principal component analysis.

        Parameters
        ----------
        estimator : PCA, or Pipeline with such a step
            Fitted on columns with names.
        n_components : int
            Number of components to draw, from the first.
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one Axes for each component.

        Returns
        -------
        LoadingsDisplay

        Raises
        ------
        ValueError
            If there is no such step, or names are not known.
        """
        step, before = _components_of(estimator)
        shares = 100 * step.explained_variance_ratio_[:n_components]
        titles = [f"component {i} ({share:.3g} %)" for i, share in enumerate(shares, 1)]
        names = getattr(step, "feature_names_in_", None)
        if names is None:
            if before is None:
                raise ValueError("the PCA was fitted without column names; fit it on a DataFrame.")
            names = before.get_feature_names_out()
        return cls(names, step.components_[:n_components], titles=titles).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the weights: one row per channel and bin, one column per component."""
        return _bars.bin_frame(self.blocks, dict(zip(self.titles, self.loadings, strict=True)))

    def _draw(self, ax: Any) -> Any:
        blocks = self.blocks if _bars.share_an_axis(self.blocks) else [_joined(self.blocks)]
        axes = _bars.bin_panels(ax, [blocks] * len(self.loadings))
        for panel, weights, title in zip(axes, self.loadings, self.titles, strict=True):
            panel.axhline(0, color="0.3", linewidth=0.6)
            for number, block in enumerate(blocks, 1):
                places, own = _bars.bin_places(block), weights[block.columns]
                if len(blocks) == 1:
                    _bars.draw_bars(panel, places, own, **bar_style(_drawing.PLAIN))
                else:
                    _bars.draw_steps(panel, places, own, block.channel, number)
            unbroken = title.replace(" ", "\u00a0")
            _drawing.label_y(panel, f"weight in {unbroken}", "1")
        _drawing.legend_above(axes[0])
        return axes


def _joined(blocks: Sequence[BinBlock]) -> BinBlock:
    """Return the bins of several channels as one row of named bins."""
    names = [f"{block.channel}@{name}" for block in blocks for name in block.names]
    return BinBlock("", tuple(names), None, np.concatenate([block.columns for block in blocks]))


@dataclass(eq=False, repr=False)
class ContributionsDisplay(OrderDisplay):
    """Contribution of each order bin to a decision, one panel for each channel.

    Parameters
    ----------
    columns : sequence of str
        Names ``channel@low-high`` or ``channel@name``, as written by `BinTransformer`.
    contributions : array-like of shape (n_columns,)
        Contribution of each bin, signed: positive values are evidence for the decision.
    fault_orders : DataFrame of `emacm.fault_orders`, or mapping of str to float, optional
        Predicted fault orders, which are marked. Those outside of the bins are not drawn.
    slip : float
        Largest relative slip: a line that slips may be lower or higher by this fraction of its
        order, and this range is shaded. In a mapping every order may slip.
    decision : str
        The decision that is explained.
    unit : str
        Unit of the contributions, such as "nats" for log odds.

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
    unit: str = field(default="nats", kw_only=True)

    def __post_init__(self, columns: Sequence[Any]) -> None:
        super().__post_init__()
        self.blocks = _bars.bin_blocks(columns)
        shape = (sum(len(block.names) for block in self.blocks),)
        self.contributions = _tables.check_values(self.contributions, "contributions", shape)

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
            As for the class: fault_orders, slip, decision, unit.

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
        return _bars.bin_frame(self.blocks, {"contribution": self.contributions})

    def _draw(self, ax: Any) -> Any:
        axes = _bars.bin_panels(ax, [[block] for block in self.blocks])
        low, high = min(0, self.contributions.min()), max(0, self.contributions.max())
        margin = 0.08 * (high - low)
        limits = (low - margin, high + margin) if margin else (-1, 1)
        for panel, block in zip(axes, self.blocks, strict=True):
            values = self.contributions[block.columns]
            for colour, hatch, word, chosen in (
                (_drawing.COLOURS[2], "", "for", values >= 0),
                (_drawing.COLOURS[4], "////", "against", values < 0),
            ):
                places, style = _bars.bin_places(block)[chosen], bar_style(colour)
                _bars.draw_bars(panel, places, values[chosen], hatch=hatch, **style)
                anywhere = np.any((self.contributions < 0) == (word == "against"))
                if panel is axes[0] and anywhere:
                    label = _drawing.wrapped(f"evidence {word} {self.decision}")
                    panel.fill_between([], [], hatch=hatch, label=label, **style)
            panel.axhline(0, color="black", linewidth=0.6)
            panel.set_ylim(limits)  # equal in all channels, for comparison
            _drawing.label_y(panel, f"contribution of {block.channel}", self.unit)
        _drawing.legend_above(axes[0], gap=_bars.mark_panels(axes, self.blocks, self.fault_orders))
        return axes
