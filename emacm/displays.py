"""Pictures: each holds computed numbers, draws them, and gives them as a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_count
from emacm.axes import column_names, parse_order_columns

# Okabe and Ito's colours, told apart by colour-blind readers; line styles tell them apart in print.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999933")
STYLES = ("-", "--", "-.", ":")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


class OrderSpectrumDisplay:
    """Order spectra, one line for each group of recordings.

    Parameters
    ----------
    orders : ndarray of shape (n_orders,)
        Orders of the lines.
    spectra : mapping of str to ndarray of shape (n_orders,)
        Power spectral density [unit²/order] by label.
    channel : str
        Channel they belong to.
    unit : str
        Unit of the channel.
    max_order : float, optional
        Highest order to draw.
    fault_orders : mapping of str to float, optional
        Orders to be marked, by name.

    Attributes
    ----------
    ax_, figure_
        What was drawn on, once `plot` has run.
    """

    def __init__(
        self,
        orders: NDArray[np.floating],
        spectra: Mapping[str, NDArray[np.floating]],
        *,
        channel: str = "signal",
        unit: str = "unit",
        max_order: float | None = None,
        fault_orders: Mapping[str, float] | None = None,
    ) -> None:
        self.orders = orders
        self.spectra = spectra
        self.channel = channel
        self.unit = unit
        self.max_order = max_order
        self.fault_orders = fault_orders

    @classmethod
    def from_table(
        cls,
        psd: Any,
        channel: str,
        *,
        labels: ArrayLike | None = None,
        unit: str = "unit",
        max_order: float | None = None,
        fault_orders: Mapping[str, float] | None = None,
        ax: Any = None,
    ) -> OrderSpectrumDisplay:
        """Draw the mean spectrum of the recordings of each label.

        Parameters
        ----------
        psd : OrderTable or DataFrame of shape (n_recordings, n_columns)
            What `OrderPSD` returns.
        channel : str
            Which channel to draw, as in its column names.
        labels : array-like of shape (n_recordings,), optional
            Label of each recording. Default: one line for all.
        unit : str
            Unit of the channel.
        max_order : float, optional
            Highest order to draw.
        fault_orders : mapping of str to float, optional
            Orders to be marked, by name.
        ax : matplotlib Axes, optional
            Where to draw.

        Returns
        -------
        OrderSpectrumDisplay

        Raises
        ------
        ValueError
            If the table carries no axis, or no such channel.
        """
        names = column_names(psd)
        blocks = None if names is None else parse_order_columns(names)
        if blocks is None:
            raise ValueError(
                "psd carries no order axis; pass what OrderPSD returns, with its columns."
            )
        known = {block.channel: block for block in blocks}
        if channel not in known:
            raise ValueError(f"psd has no channel {channel!r}, only {list(known)}.")
        block = known[channel]
        values = np.asarray(psd)[:, block.columns]
        groups = np.full(len(values), channel) if labels is None else np.asarray(labels)
        if groups.shape != (len(values),):
            raise ValueError(
                f"labels must hold one label for each of {len(values)} recordings, got shape "
                f"{groups.shape}."
            )
        spectra = {str(name): values[groups == name].mean(axis=0) for name in np.unique(groups)}
        display = cls(
            block.orders,
            spectra,
            channel=channel,
            unit=unit,
            max_order=max_order,
            fault_orders=fault_orders,
        )
        return display.plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the numbers: a row an order, a column a label."""
        return pd.DataFrame({**self.spectra}, index=pd.Index(self.orders, name="order"))

    def plot(self, *, ax: Any = None) -> OrderSpectrumDisplay:
        """Draw the spectra in dB against the order.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw. Default: a new figure.

        Returns
        -------
        OrderSpectrumDisplay
            Itself.
        """
        ax = _axes(ax)
        top = self.orders[-1] if self.max_order is None else self.max_order
        # The first line is bent by detrending, and is no fault's order.
        drawn = (self.orders > 0) & (self.orders <= top)
        for i, (label, spectrum) in enumerate(self.spectra.items()):
            power = 10 * np.log10(np.maximum(spectrum[drawn], np.finfo(float).tiny))
            style = {"color": COLOURS[i % len(COLOURS)], "linestyle": STYLES[i % len(STYLES)]}
            ax.plot(self.orders[drawn], power, label=label, linewidth=1.2, **style)
        for name, order in (self.fault_orders or {}).items():
            ax.axvline(order, color="0.75", linewidth=0.8, zorder=0)
            ax.text(order, 1.01, name, transform=ax.get_xaxis_transform(), fontsize=8, ha="center")
        squared = f"({self.unit})²" if "/" in self.unit else f"{self.unit}²"
        ax.set(
            xlabel="order [cycles per revolution]",
            ylabel=f"PSD of {self.channel} [dB re 1 {squared}/order]",
            xlim=(0, top),
        )
        ax.legend(fontsize=8)
        self.ax_, self.figure_ = ax, ax.figure
        return self


class DecisionRegionsDisplay:
    """Decisions of a classifier in a plane of two features, under its cost matrix.

    Parameters
    ----------
    first, second : ndarray of shape (n_grid,)
        Values of the two features along the grid.
    regions : ndarray of shape (n_grid, n_grid)
        Number of the decision taken at each point, rows along `second`.
    decisions : sequence of str
        Names of the decisions.
    points : ndarray of shape (n_recordings, 2)
        Recordings to be shown.
    labels : ndarray of shape (n_recordings,)
        Their true classes.
    names : tuple of two str
        Names of the features, with units.

    Attributes
    ----------
    ax_, figure_
        What was drawn on, once `plot` has run.
    """

    def __init__(
        self,
        first: NDArray[np.floating],
        second: NDArray[np.floating],
        regions: NDArray[np.intp],
        decisions: Sequence[Any],
        points: NDArray[np.floating],
        labels: NDArray[Any],
        *,
        names: tuple[str, str] = ("feature 1", "feature 2"),
    ) -> None:
        self.first = first
        self.second = second
        self.regions = regions
        self.decisions = decisions
        self.points = points
        self.labels = labels
        self.names = names

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: ArrayLike,
        y: ArrayLike,
        *,
        names: tuple[str, str] = ("feature 1", "feature 2"),
        n_grid: int = 300,
        ax: Any = None,
    ) -> DecisionRegionsDisplay:
        """Ask a fitted classifier of two features all over the plane, and draw.

        Parameters
        ----------
        estimator : CostSensitiveGaussianBayes
            Fitted on two features.
        X : array-like of shape (n_recordings, 2)
            Features of the recordings to be shown.
        y : array-like of shape (n_recordings,)
            Their true classes.
        names : tuple of two str
            Names of the features, with units.
        n_grid : int
            Points along each axis.
        ax : matplotlib Axes, optional
            Where to draw.

        Returns
        -------
        DecisionRegionsDisplay

        Raises
        ------
        ValueError
            If there are not two features.
        """
        points = np.asarray(X, dtype=float)
        if points.ndim != 2 or points.shape[1] != 2:
            raise ValueError(
                f"decision regions are drawn over two features, got X of shape {points.shape}. "
                f"Fit the classifier on two of them."
            )
        check_count(n_grid, "n_grid", at_least=2)
        low, high = points.min(axis=0), points.max(axis=0)
        margin = 0.08 * (high - low) + 1e-12
        first, second = np.linspace(low - margin, high + margin, n_grid).T
        grid = np.column_stack([axis.ravel() for axis in np.meshgrid(first, second)])
        decisions = list(estimator.decisions_)
        number = {decision: i for i, decision in enumerate(decisions)}
        regions = np.array([number[decision] for decision in estimator.predict(grid)])
        display = cls(
            first,
            second,
            regions.reshape(n_grid, n_grid),
            decisions,
            points,
            np.asarray(y),
            names=names,
        )
        return display.plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the recordings: two features, and the true class."""
        table = pd.DataFrame(self.points, columns=list(self.names))
        return table.assign(true=self.labels)

    def plot(self, *, ax: Any = None) -> DecisionRegionsDisplay:
        """Draw regions as areas and recordings as marks.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw. Default: a new figure.

        Returns
        -------
        DecisionRegionsDisplay
            Itself.
        """
        ax = _axes(ax)
        n_decisions = len(self.decisions)
        shades = [COLOURS[i % len(COLOURS)] for i in range(n_decisions)]
        levels = np.arange(n_decisions + 1) - 0.5
        ax.contourf(self.first, self.second, self.regions, levels=levels, colors=shades, alpha=0.25)
        colour = dict(zip(map(str, self.decisions), shades, strict=True))
        for i, label in enumerate(np.unique(self.labels)):
            chosen = self.labels == label
            ax.scatter(
                *self.points[chosen].T,
                s=18,
                marker=MARKERS[i % len(MARKERS)],
                color=colour.get(str(label), "0.3"),
                edgecolor="white",
                linewidth=0.4,
                label=f"true: {label}",
            )
        for decision, shade in colour.items():
            ax.fill([], [], color=shade, alpha=0.25, label=f"decided: {decision}")
        ax.set(xlabel=self.names[0], ylabel=self.names[1])
        ax.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1), borderaxespad=0)
        self.ax_, self.figure_ = ax, ax.figure
        return self


def _axes(ax: Any) -> Any:
    """Return the axes, or new ones; matplotlib is imported only here."""
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("pictures need matplotlib; install emacm[plot].") from error
    return pyplot.subplots(layout="constrained")[1]
