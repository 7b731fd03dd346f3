"""Recordings in a plane of two features: class densities and decision regions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.utils import check_consistent_length
from sklearn.utils.validation import check_is_fitted

from emacm.displays import drawing, drawn_values
from emacm.displays.drawing import Display

FEATURES = ("feature 1", "feature 2")


class PlaneDisplay(Display):
    """Recordings in a plane of two features."""

    points: Any
    labels: Any
    names: tuple[str, str]
    healthy: Any

    def frame(self) -> pd.DataFrame:
        """Return the recordings: two features, and the true class."""
        table = pd.DataFrame(self.points, columns=list(self.names))
        return table.assign(true=self.labels)

    def _check_points(self, states: Sequence[Any]) -> None:
        """Check the recordings; `states` are those that the classifier knows."""
        self.points = drawn_values.check_values(self.points, "points", (None, 2))
        self.labels = np.asarray(self.labels)
        check_consistent_length(self.points, self.labels)
        self._trained_states = [str(state) for state in states]
        found = [*self._trained_states, *np.unique(self.labels)]
        self._numbers = drawing.state_numbers(found, self.healthy)

    def _draw_points(self, ax: Any) -> dict[str, Any]:
        """Draw the recordings of each state; states unknown to the classifier in grey."""
        truths = np.array([str(label) for label in self.labels])
        markers = {}
        for name, number in self._numbers.items():
            if name in truths:
                colour = drawing.colour_of(number) if name in self._trained_states else "0.3"
                look = {"color": colour, "edgecolor": "white", "linewidth": 0.4, "zorder": 2}
                look["marker"] = drawing.style_of(drawing.MARKERS, number)
                markers[name] = ax.scatter(*self.points[truths == name].T, s=20, **look)
        return markers

    def _name_states(
        self, ax: Any, markers: Mapping[str, Any], others: Mapping[str, Any], title: str
    ) -> None:
        """Label the axes, and put a legend above with one entry per state that is drawn."""
        ax.set(xlabel=self.names[0], ylabel=self.names[1])
        drawn = [name for name in self._numbers if name in markers or name in others]
        pairs = [tuple(own[k] for own in (others, markers) if k in own) for k in drawn]
        self.entries_ = dict(zip(drawn, pairs, strict=True))  # for one legend of several displays
        drawing.legend_above(ax, handles=pairs, labels=drawn, title=title)


@dataclass(eq=False, repr=False)
class FeatureDensityDisplay(PlaneDisplay):
    """Recordings in a plane of two features, and the Gaussian density of each class.

    Each density is drawn as the ellipses of equal density that contain a given share of its
    probability.

    Parameters
    ----------
    classes : sequence
        The classes.
    means : array-like of shape (n_classes, 2)
        Mean of each class.
    covariances : array-like of shape (n_classes, 2, 2)
        Covariance of each class.
    points : array-like of shape (n_recordings, 2)
        Recordings to draw; may be empty.
    labels : array-like of shape (n_recordings,)
        Their true classes. One that is not among `classes` is drawn in grey.
    shares : sequence of float
        Probability within each ellipse, between 0 and 1. Without any, only recordings are drawn.
    names : tuple of two str
        Names of the features, with units.
    healthy : str
        The healthy class: it is first in the legend and always has the same colour.

    Attributes
    ----------
    ax_, figure_
        Axes and figure, set when the display is drawn.

    Raises
    ------
    TypeError, ValueError
        If shapes do not fit, or a value is not finite.

    Notes
    -----
    Two Gaussian features are within Mahalanobis distance r of their mean with
    probability 1 - exp(-r²/2), since r² has a chi-squared distribution with two degrees of
    freedom. Source of this kind of figure: Chirico, Figs. 3.8 and 3.9.

    Examples
    --------
    >>> import numpy as np
    >>> display = FeatureDensityDisplay(
    ...     ["healthy"], [[0, 0]], [np.eye(2)], np.zeros((1, 2)), ["healthy"]
    ... )
    >>> print(display.ellipse(0, 0.5).max().round(3))  # the median of r
    1.177
    """

    classes: Any
    means: Any
    covariances: Any
    points: Any
    labels: Any
    shares: Sequence[float] = field(default=(0.5, 0.9), kw_only=True)
    names: tuple[str, str] = field(default=FEATURES, kw_only=True)
    healthy: Any = field(default=drawing.HEALTHY, kw_only=True)

    def __post_init__(self) -> None:
        self.means, self.covariances = np.asarray(self.means), np.asarray(self.covariances)
        self._check_points(self.classes)

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: ArrayLike, y: ArrayLike, *, ax: Any = None, **options: Any
    ) -> FeatureDensityDisplay:
        """Draw the densities of a fitted classifier of two features.

        Parameters
        ----------
        estimator : CostSensitiveGaussianBayes
            Fitted on two features.
        X : array-like of shape (n_recordings, 2)
            Features of the recordings to draw.
        y : array-like of shape (n_recordings,)
            Their true classes.
        ax : matplotlib Axes, optional
            Where to draw.
        **options
            As for the class: shares, names, healthy.

        Returns
        -------
        FeatureDensityDisplay

        Raises
        ------
        TypeError, ValueError
            If there are not two features, a value is not finite, or an option is invalid.
        """
        check_is_fitted(estimator)
        if estimator.n_features_in_ != 2:
            raise ValueError(
                f"two features are drawn, but the classifier was fitted on "
                f"{estimator.n_features_in_}. Fit it on two of them."
            )
        means = np.asarray(estimator.means_)
        covariances = np.asarray(estimator.covariances_)
        if estimator.covariance == "diag":
            covariances = covariances[:, np.newaxis] * np.eye(2)
        covariances = np.broadcast_to(covariances, (len(means), 2, 2))
        classes = list(estimator.classes_)
        return cls(classes, means, covariances, X, y, **options).plot(ax=ax)

    def ellipse(self, number: int, share: float) -> NDArray[np.floating]:
        """Return the ellipse that contains a share of the probability of a class.

        Parameters
        ----------
        number : int
            Number of the class.
        share : float
            Probability within, between 0 and 1.

        Returns
        -------
        ndarray of shape (2, n_corners)
            A closed line in the units of the features.
        """
        radius = np.sqrt(-2 * np.log1p(-share))
        turn = np.linspace(0, 2 * np.pi, 181)
        # Eigenvectors, not Cholesky: the covariance of a class may be singular.
        powers, axes = np.linalg.eigh(self.covariances[number])
        widths = np.sqrt(np.maximum(powers, 0))
        circle = radius * np.stack([np.cos(turn), np.sin(turn)])
        return self.means[number][:, np.newaxis] + axes @ (widths[:, np.newaxis] * circle)

    def _draw(self, ax: Any) -> Any:
        (ax,) = drawing.panel_axes(ax, height=3.8)
        markers, lines = self._draw_points(ax), {}
        for number, name in enumerate(map(str, self.classes)):
            for share in self.shares:
                style = {"linewidth": 1.2, **drawing.line_style(self._numbers[name])}
                (lines[name],) = ax.plot(*self.ellipse(number, share), **style)
        held = " and ".join(f"{100 * share:.3g}" for share in self.shares)
        title = f"ellipses: {held} % of a class" if self.shares else ""
        self._name_states(ax, markers, lines, title)
        return ax


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
        If shapes do not fit, a value is not finite.

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
    healthy: Any = field(default=drawing.HEALTHY, kw_only=True)
    unknown: Any = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        self.first, self.second = np.asarray(self.first), np.asarray(self.second)
        self.regions = np.asarray(self.regions)
        self._check_points(self.decisions)

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: Any, y: Any, *, n_grid: int = 300, ax: Any = None, **options: Any
    ) -> DecisionRegionsDisplay:
        """Draw the decisions of a fitted classifier of two features.

        The grid extends 8 % beyond the range of the recordings, or 100 % for a classifier with an
        unknown state, which is decided far from them.

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
        points = drawn_values.check_values(X, "points", (None, 2))
        unknown = options.setdefault("unknown", getattr(estimator, "unknown", None))
        margin = 0.08 if unknown is None else 1.0
        low, high = points.min(axis=0), points.max(axis=0)
        # Points on a line still have a plane around them.
        width = np.where(high > low, high - low, np.maximum(1e-9, np.abs(high)))
        first, second = np.linspace(low - margin * width, high + margin * width, n_grid).T
        grid: Any = np.column_stack([axis.ravel() for axis in np.meshgrid(first, second)])
        if hasattr(estimator, "feature_names_in_"):
            grid = pd.DataFrame(grid, columns=estimator.feature_names_in_)
        decisions = list(estimator.decisions_)
        regions = pd.Index(decisions).get_indexer(estimator.predict(grid)).reshape(n_grid, n_grid)
        return cls(first, second, regions, decisions, points, y, **options).plot(ax=ax)

    def _draw(self, ax: Any) -> Any:
        (ax,) = drawing.panel_axes(ax, height=3.8)
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
        colour, hatch = drawing.colour_of(number), drawing.style_of(drawing.HATCHES, number)
        if str(self.decisions[code]) == str(self.unknown):
            colour, hatch = "#555555", ".."
        colour = drawing.tint(colour, 0.22)
        # One decision at a time: contours between two numbers would pass through others.
        inside = (self.regions == code).astype(float)
        plane = (self.first, self.second, inside)
        ax.contourf(*plane, levels=[0.5, 1.5], colors=[colour], hatches=[hatch], zorder=0.5)
        if not inside.all():
            ax.contour(*plane, levels=[0.5], colors="0.2", linewidths=0.8, zorder=0.6)
        return ax.fill([], [], facecolor=colour, edgecolor=_LINES, hatch=hatch)[0]
