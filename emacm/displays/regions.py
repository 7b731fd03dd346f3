"""Pictures of decisions: what a classifier decides all over a plane of two features."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_count
from emacm.displays._drawing import (
    HATCHES,
    colour_of,
    legend_beside,
    one_axes,
    one_of,
    tint,
    wrapped,
)
from emacm.displays._tables import (
    check_labels,
    check_values,
)
from emacm.displays.densities import draw_recordings, plane_limits, plane_points

_LIGHT = 0.22  # share of the colour in the tint of a region
_LINES = "0.72"  # grey of hatches


class DecisionRegionsDisplay:
    """Decisions of a classifier in a plane of two features, under its cost matrix.

    Parameters
    ----------
    first, second : ndarray of shape (n_first,), (n_second,)
        Values of the two features along the grid.
    regions : ndarray of shape (n_second, n_first)
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

    Raises
    ------
    TypeError, ValueError
        If shapes do not fit, a number is not finite, or a region is no decision.

    Notes
    -----
    Source of such pictures: Chirico, Figs. 2.13, 2.14 and 3.10.
    """

    ax_: Any
    figure_: Any

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
        self.first = check_values(first, "first", (None,))
        self.second = check_values(second, "second", (None,))
        check_values(regions, "regions", (len(self.second), len(self.first)), least=0)
        self.regions = np.asarray(regions)
        self.decisions = list(decisions)
        if self.regions.size and self.regions.max() >= len(self.decisions):
            raise ValueError(
                f"regions hold decision number {self.regions.max()}, but there are "
                f"{len(self.decisions)} decisions, counted from 0."
            )
        self.points = check_values(points, "points", (None, 2))
        self.labels = check_labels(labels, len(self.points))
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
        TypeError, ValueError
            If there are not two features, or a number is not finite.
        """
        points = plane_points(X, "decision regions are")
        check_count(n_grid, "n_grid", at_least=2)
        low, high = plane_limits(points)
        first, second = np.linspace(low, high, n_grid).T
        grid: Any = np.column_stack([axis.ravel() for axis in np.meshgrid(first, second)])
        seen = getattr(estimator, "feature_names_in_", None)
        if seen is not None:
            grid = pd.DataFrame(grid, columns=seen)
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
        """Draw regions as areas, hatched but for the first, and recordings as marks.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw. Default: a new figure.

        Returns
        -------
        DecisionRegionsDisplay
            Itself.
        """
        ax = one_axes(ax)
        from matplotlib import rc_context

        places = {str(decision): i for i, decision in enumerate(self.decisions)}
        draw_recordings(ax, self.points, self.labels, "true: ", places=places)
        with rc_context({"hatch.color": _LINES, "hatch.linewidth": 0.6}):
            for number, decision in enumerate(self.decisions):
                area = {"facecolor": tint(colour_of(number), _LIGHT), "edgecolor": _LINES}
                hatch = one_of(HATCHES, number)
                ax.fill([], [], **area, hatch=hatch, label=wrapped(f"decided: {decision}"))
                self._draw_region(ax, number, area["facecolor"], hatch)
        ax.set(
            xlabel=self.names[0],
            ylabel=self.names[1],
            xlim=self.first[[0, -1]],
            ylim=self.second[[0, -1]],
        )
        legend_beside(ax)
        self.ax_, self.figure_ = ax, ax.figure
        return self

    def _draw_region(self, ax: Any, number: int, colour: str, hatch: str) -> None:
        # One decision at a time: between the numbers of two neighbours lies no third decision.
        inside = (self.regions == number).astype(float)
        if not inside.any():
            return
        plane = (self.first, self.second, inside)
        ax.contourf(*plane, levels=[0.5, 1.5], colors=[colour], hatches=[hatch], zorder=0.5)
        if not inside.all():
            ax.contour(*plane, levels=[0.5], colors="0.2", linewidths=0.8, zorder=0.6)
