"""Decisions of a classifier over a plane of two features."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from emacm._checks import check_count, check_number
from emacm.displays import _drawing, _tables
from emacm.displays._plane import (
    FEATURES,
    MARGIN,
    PlaneDisplay,
    check_classifier,
    plane_limits,
    plane_points,
)

_LIGHT = 0.22  # share of the colour in the tint of a region
_UNKNOWN = ("#555555", "..")  # colour and hatch of the unknown state
_MARGIN_OF_UNKNOWN = 1.0
_LINES = "0.72"  # grey of hatches


@dataclass(eq=False, repr=False)
class DecisionRegionsDisplay(PlaneDisplay):
    """Decisions of a classifier in a plane of two features, under its cost matrix.

    Parameters
    ----------
    first : array-like of shape (n_first,)
        Values of the first feature along the grid, the x axis.
    second : array-like of shape (n_second,)
        Values of the second feature along the grid, the y axis.
    regions : array-like of shape (n_second, n_first)
        Number of the decision at each point of the grid: one row per value of `second`.
    decisions : sequence
        Names of the decisions.
    points : array-like of shape (n_recordings, 2)
        Recordings to draw.
    labels : array-like of shape (n_recordings,)
        Their true classes. One that is not among `decisions` is drawn in grey.
    names : tuple of two str
        Names of the features, with units.
    healthy : str
        The healthy class: it is first in the legend and always has the same colour.
    unknown : str, optional
        The decision on the unknown state, which is drawn in grey.

    Attributes
    ----------
    ax_, figure_
        Axes and figure, set when the display is drawn.

    Raises
    ------
    TypeError, ValueError
        If shapes do not fit, a value is not finite, or a number in `regions` is not a decision.

    Notes
    -----
    Source of this kind of figure: Chirico, Figs. 2.13, 2.14 and 3.10.
    """

    first: Any
    second: Any
    regions: Any
    decisions: Any
    points: Any
    labels: Any
    names: tuple[str, str] = field(default=FEATURES, kw_only=True)
    healthy: Any = field(default=_drawing.HEALTHY, kw_only=True)
    unknown: Any = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        self.first = _tables.check_values(self.first, "first", (None,))
        self.second = _tables.check_values(self.second, "second", (None,))
        shape = (len(self.second), len(self.first))
        if min(shape) < 2:
            raise ValueError(f"first and second must hold at least two values, got {shape[::-1]}.")
        numbers = _tables.check_values(self.regions, "regions", shape, least=0)
        self.regions = numbers.astype(int)
        wrong = numbers[(numbers != self.regions) | (numbers >= len(self.decisions))]
        if len(wrong):
            raise ValueError(
                f"regions hold decision number {wrong[0]:g}, but there are "
                f"{len(self.decisions)} decisions, counted from 0."
            )
        self._check_points(self.decisions)

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: ArrayLike,
        y: ArrayLike,
        *,
        n_grid: int = 300,
        margin: float | None = None,
        ax: Any = None,
        **options: Any,
    ) -> DecisionRegionsDisplay:
        """Draw the decisions of a fitted classifier of two features.

        Parameters
        ----------
        estimator : CostSensitiveGaussianBayes
            Fitted on two features.
        X : array-like of shape (n_recordings, 2)
            Features of the recordings to draw.
        y : array-like of shape (n_recordings,)
            Their true classes.
        n_grid : int
            Number of points along each axis at which the classifier decides.
        margin : float, optional
            Space around the recordings, as a fraction of their range. Default: 0.08, and 1 for a
            classifier with an unknown state, which is decided far from the recordings.
        ax : matplotlib Axes, optional
            Where to draw.
        **options
            As for the class: names, healthy. `unknown` is that of the classifier.

        Returns
        -------
        DecisionRegionsDisplay

        Raises
        ------
        TypeError, ValueError
            If there are not two features, a value is not finite, or an option is invalid.
        """
        points = plane_points(X, "decision regions are")
        check_classifier(estimator, "decisions_")
        check_count(n_grid, "n_grid", at_least=2, at_most=5000)
        unknown = options.setdefault("unknown", getattr(estimator, "unknown", None))
        if margin is None:
            margin = MARGIN if unknown is None else _MARGIN_OF_UNKNOWN
        low, high = plane_limits(points, check_number(margin, "margin", at_least=0))
        first, second = np.linspace(low, high, n_grid).T
        grid: Any = np.column_stack([axis.ravel() for axis in np.meshgrid(first, second)])
        seen = getattr(estimator, "feature_names_in_", None)
        if seen is not None:
            grid = pd.DataFrame(grid, columns=seen)
        decisions = list(estimator.decisions_)
        number = {decision: i for i, decision in enumerate(decisions)}
        regions = np.array([number[decision] for decision in estimator.predict(grid)])
        regions = regions.reshape(n_grid, n_grid)
        return cls(first, second, regions, decisions, points, y, **options).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the recordings: two features, and the true class."""
        table = pd.DataFrame(self.points, columns=list(self.names))
        return table.assign(true=self.labels)

    def _draw(self, ax: Any) -> Any:
        (ax,) = _drawing.panel_axes(ax, height=3.8)
        from matplotlib import rc_context

        markers, areas = self._draw_points(ax), {}
        with rc_context({"hatch.color": _LINES, "hatch.linewidth": 0.6}):
            for code, name in enumerate(map(str, self.decisions)):
                if np.any(self.regions == code):
                    areas[name] = self._draw_region(ax, code, self._numbers[name])
        ax.set(xlim=self.first[[0, -1]], ylim=self.second[[0, -1]])
        self._name_states(ax, markers, areas, "area: decision, marker: true state")
        return ax

    def _draw_region(self, ax: Any, code: int, number: int) -> Any:
        """Draw the region of one decision; return a patch for the legend."""
        colour, hatch = _drawing.colour_of(number), _drawing.style_of(_drawing.HATCHES, number)
        if str(self.decisions[code]) == str(self.unknown):
            colour, hatch = _UNKNOWN
        colour = _drawing.tint(colour, _LIGHT)
        # One decision at a time: contours between two numbers would pass through others.
        inside = (self.regions == code).astype(float)
        plane = (self.first, self.second, inside)
        ax.contourf(*plane, levels=[0.5, 1.5], colors=[colour], hatches=[hatch], zorder=0.5)
        if not inside.all():
            ax.contour(*plane, levels=[0.5], colors="0.2", linewidths=0.8, zorder=0.6)
        return ax.fill([], [], facecolor=colour, edgecolor=_LINES, hatch=hatch)[0]
