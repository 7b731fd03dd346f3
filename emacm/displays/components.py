"""Pictures of a principal component analysis: the variance it explains, and by which bins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_count
from emacm.displays._bars import (
    bin_blocks,
    bin_panels,
    bin_places,
    draw_bars,
    draw_steps,
    share_an_axis,
)
from emacm.displays._drawing import (
    COLOURS,
    legend_beside,
    line_style,
    name_side,
    one_axes,
    tint,
    wrapped,
)
from emacm.displays._tables import (
    check_values,
    pipeline_until,
)
from emacm.orders.columns import BinBlock


class ExplainedVarianceDisplay:
    """Share of the variance that each principal component explains.

    Parameters
    ----------
    shares : array-like of shape (n_components,)
        Share of each component, from 0 to 1.
    n_shown : int
        How many of them to draw at the most.

    Attributes
    ----------
    ax_, figure_
        What was drawn on, once `plot` has run.

    Raises
    ------
    TypeError, ValueError
        If shares are negative, not finite, or add up to more than 1.

    Notes
    -----
    Source of such pictures: Chirico, Fig. 3.6.

    Examples
    --------
    >>> ExplainedVarianceDisplay([0.75, 0.25]).frame()["cumulative"].to_dict()
    {1: 0.75, 2: 1.0}
    """

    ax_: Any
    figure_: Any

    def __init__(self, shares: ArrayLike, *, n_shown: int = 20) -> None:
        self.shares = check_values(shares, "shares", (None,), least=0)
        if not len(self.shares) or self.shares.sum() > 1 + 1e-5:  # as float32 may
            raise ValueError(
                f"shares must hold at least one, and add up to at most 1; got "
                f"{len(self.shares)} that add up to {self.shares.sum():.6g}."
            )
        self.n_shown = check_count(n_shown, "n_shown")

    @classmethod
    def from_estimator(
        cls, estimator: Any, *, n_shown: int = 20, ax: Any = None
    ) -> ExplainedVarianceDisplay:
        """Draw the shares of a fitted principal component analysis.

        Parameters
        ----------
        estimator : PCA, or Pipeline with such a step
            Fitted; anything with `explained_variance_ratio_`.
        n_shown : int
            How many components to draw at the most.
        ax : matplotlib Axes, optional
            Where to draw.

        Returns
        -------
        ExplainedVarianceDisplay

        Raises
        ------
        ValueError
            If there is no such step.
        """
        step, _ = pipeline_until(
            estimator, lambda s: hasattr(s, "explained_variance_ratio_"), "a fitted PCA"
        )
        return cls(step.explained_variance_ratio_, n_shown=n_shown).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the numbers: a row a component, its share and the sum up to it."""
        index = pd.RangeIndex(1, len(self.shares) + 1, name="component")
        return pd.DataFrame(
            {"share": self.shares, "cumulative": np.cumsum(self.shares)}, index=index
        )

    def plot(self, *, ax: Any = None) -> ExplainedVarianceDisplay:
        """Draw the shares as bars, and their sum as a line.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw. Default: a new figure.

        Returns
        -------
        ExplainedVarianceDisplay
            Itself.
        """
        ax = one_axes(ax)
        table = 100 * self.frame().iloc[: self.n_shown]
        style = {"color": tint(COLOURS[0], 0.6), "edgecolor": "black", "linewidth": 0.5}
        ax.bar(table.index, table["share"], label="each", **style)
        ax.plot(
            table.index, table["cumulative"], "s--", color=COLOURS[1], markersize=4, label="sum"
        )
        ax.set(
            xlabel="principal component",
            ylabel="share of the variance [%]",
            xlim=(0.3, len(table) + 0.7),
            ylim=(0, 105),
        )
        ax.xaxis.get_major_locator().set_params(integer=True)
        legend_beside(ax)
        self.ax_, self.figure_ = ax, ax.figure
        return self


class LoadingsDisplay:
    """Weight of each order bin in the principal components, one panel for each component.

    One channel is drawn as bars, several as a line of steps each.

    Parameters
    ----------
    columns : sequence of str or of (low, high)
        Names ``channel@low-high`` or ``channel@name``, as `BinTransformer` writes them; or the
        edges [orders] of the bins of one channel.
    loadings : array-like of shape (n_components, n_columns)
        Components of the eigenvectors, signed, without unit.
    titles : sequence of str, optional
        What to call the components. Default: "component 1" and so on.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (n_components,)
        What was drawn on, once `plot` has run.
    figure_ : Figure
        The figure of `ax_`.

    Raises
    ------
    TypeError, ValueError
        If loadings do not fit the columns, or are not finite.

    Notes
    -----
    Source of such pictures: Chirico, Fig. 3.7, which shows magnitudes. The sign of a whole
    component means nothing; signs within it tell which bins rise together.

    Examples
    --------
    >>> display = LoadingsDisplay(["current@0-1", "current@1-2"], [[0.6, -0.8]])
    >>> display.frame()["component 1"].to_dict()
    {('current', '0-1'): 0.6, ('current', '1-2'): -0.8}
    """

    ax_: Any
    figure_: Any

    def __init__(
        self,
        columns: Sequence[Any],
        loadings: ArrayLike,
        *,
        titles: Sequence[str] | None = None,
    ) -> None:
        self.blocks = bin_blocks(columns)
        n_columns = sum(len(block.names) for block in self.blocks)
        self.loadings = check_values(loadings, "loadings", (None, n_columns))
        if not len(self.loadings):
            raise ValueError("loadings hold no component; at least one is needed.")
        numbered = [f"component {i + 1}" for i in range(len(self.loadings))]
        self.titles = numbered if titles is None else [str(title) for title in titles]
        if len(self.titles) != len(self.loadings):
            raise ValueError(
                f"titles must name {len(self.loadings)} components, got {len(self.titles)}."
            )

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        columns: Sequence[Any] | None = None,
        *,
        n_components: int = 2,
        ax: Any = None,
    ) -> LoadingsDisplay:
        """Draw the first components of a fitted principal component analysis.

        Parameters
        ----------
        estimator : PCA, or Pipeline with such a step
            Fitted; anything with `components_`.
        columns : sequence of str or of (low, high), optional
            What goes into it. Default: what the steps before it call their columns.
        n_components : int
            How many components to draw, from the first.
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one for each component.

        Returns
        -------
        LoadingsDisplay

        Raises
        ------
        ValueError
            If there is no such step, it has fewer components, or names are not known.
        """
        step, before = pipeline_until(
            estimator, lambda s: hasattr(s, "components_"), "a fitted PCA"
        )
        check_count(n_components, "n_components")
        if n_components > len(step.components_):
            raise ValueError(
                f"n_components = {n_components}, but the PCA has {len(step.components_)}."
            )
        names = _names_into(step, before) if columns is None else columns
        shares = getattr(step, "explained_variance_ratio_", None)
        titles = None
        if shares is not None:
            titles = [f"component {i + 1} ({100 * shares[i]:.3g} %)" for i in range(n_components)]
        return cls(names, step.components_[:n_components], titles=titles).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the numbers: a row a channel and bin, a column a component."""
        rows = [(block.channel, name) for block in self.blocks for name in block.names]
        places = np.concatenate([block.columns for block in self.blocks])
        index = pd.MultiIndex.from_tuples(rows, names=["channel", "bin"])
        return pd.DataFrame(self.loadings[:, places].T, index=index, columns=self.titles)

    def plot(self, *, ax: Any = None) -> LoadingsDisplay:
        """Draw the weight of each bin against the order.

        Parameters
        ----------
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one for each component. Default: a new figure.

        Returns
        -------
        LoadingsDisplay
            Itself.
        """
        blocks = self.blocks if share_an_axis(self.blocks) else [_joined(self.blocks)]
        axes = bin_panels(ax, blocks[:1], n_rows=len(self.loadings))
        for panel, weights, title in zip(axes, self.loadings, self.titles, strict=True):
            panel.axhline(0, color="0.3", linewidth=0.6)
            _draw_weights(panel, blocks, weights)
            whole = title.replace(" ", "\u00a0")  # a line does not break within
            name_side(panel, f"weight in {whole}", "1")
        legend_beside(axes[0])
        self.ax_, self.figure_ = axes, axes[0].figure
        return self


def _draw_weights(panel: Any, blocks: Sequence[BinBlock], weights: Any) -> None:
    if len(blocks) == 1:
        (block,) = blocks
        draw_bars(panel, bin_places(block), weights[block.columns], color=tint(COLOURS[0], 0.6))
        return
    for number, block in enumerate(blocks):
        style = {**line_style(number), "label": wrapped(block.channel)}
        draw_steps(panel, bin_places(block), weights[block.columns], **style)
    edges = np.concatenate([bin_places(block) for block in blocks])
    if blocks[0].bands is not None:
        panel.set_xlim(edges.min(), edges.max())


def _joined(blocks: Sequence[BinBlock]) -> BinBlock:
    """Return the bins of several channels as one row of named bins."""
    names = [f"{block.channel}@{name}" for block in blocks for name in block.names]
    return BinBlock("", tuple(names), None, np.concatenate([block.columns for block in blocks]))


def _names_into(step: Any, before: Any) -> Sequence[str]:
    """Return the names of the columns that a fitted step was given."""
    check_is_fitted(step)
    seen = getattr(step, "feature_names_in_", None)
    if seen is not None:
        return list(seen)
    try:
        return list(before.get_feature_names_out())
    except (AttributeError, ValueError) as error:
        raise ValueError(
            "the steps before the PCA do not tell the names of its columns; pass columns, or give "
            "FunctionTransformer feature_names_out='one-to-one'."
        ) from error
