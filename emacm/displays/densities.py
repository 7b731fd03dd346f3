"""Pictures of the feature plane: recordings, and the Gaussian density of each class."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_number
from emacm.displays._drawing import (
    MARKERS,
    colour_of,
    legend_beside,
    line_style,
    one_axes,
    one_of,
    wrapped,
)
from emacm.displays._tables import (
    check_labels,
    check_values,
)

_MARGIN = 0.08  # of the range of the recordings, left free around them
_CORNERS = 181  # of the polygon that stands for an ellipse


class FeatureDensityDisplay:
    """Recordings in a plane of two features, and the Gaussian density of each class.

    Each density is drawn by the ellipses that hold a stated share of its
    probability: lines of equal density, the higher the share the lower.

    Parameters
    ----------
    classes : sequence
        The classes.
    means : ndarray of shape (n_classes, 2)
        Mean of each.
    covariances : ndarray of shape (n_classes, 2, 2)
        Covariance of each.
    points : ndarray of shape (n_recordings, 2)
        Recordings to be shown; may be none.
    labels : ndarray of shape (n_recordings,)
        Their true classes.
    shares : sequence of float
        Probability within each ellipse, between 0 and 1. Without any, recordings alone
        are drawn.
    names : tuple of two str
        Names of the features, with units.

    Attributes
    ----------
    ax_, figure_
        What was drawn on, once `plot` has run.

    Raises
    ------
    TypeError, ValueError
        If shapes do not fit, a number is not finite, or a share not between 0 and 1.

    Notes
    -----
    Two Gaussian features lie within Mahalanobis distance r of their mean with
    probability 1 - exp(-r²/2), as r² has a chi-squared distribution of two degrees of
    freedom. Source of such pictures: Chirico, Figs. 3.8 and 3.9.

    Examples
    --------
    >>> import numpy as np
    >>> display = FeatureDensityDisplay(
    ...     ["healthy"], [[0, 0]], [np.eye(2)], np.zeros((1, 2)), ["healthy"]
    ... )
    >>> print(display.ellipse(0, 0.5).max().round(3))  # the median of r
    1.177
    """

    ax_: Any
    figure_: Any

    def __init__(
        self,
        classes: Sequence[Any],
        means: ArrayLike,
        covariances: ArrayLike,
        points: ArrayLike,
        labels: ArrayLike,
        *,
        shares: Sequence[float] = (0.5, 0.9),
        names: tuple[str, str] = ("feature 1", "feature 2"),
    ) -> None:
        self.classes = list(classes)
        n_classes = len(self.classes)
        self.means = check_values(means, "means", (n_classes, 2))
        self.covariances = check_values(covariances, "covariances", (n_classes, 2, 2))
        self.points = check_values(points, "points", (None, 2))
        self.labels = check_labels(labels, len(self.points))
        self.shares = tuple(check_number(p, "a share", above=0, below=1) for p in shares)
        self.names = names

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: ArrayLike,
        y: ArrayLike,
        *,
        shares: Sequence[float] = (0.5, 0.9),
        names: tuple[str, str] = ("feature 1", "feature 2"),
        ax: Any = None,
    ) -> FeatureDensityDisplay:
        """Take the densities of a fitted classifier of two features, and draw.

        Parameters
        ----------
        estimator : CostSensitiveGaussianBayes
            Fitted on two features.
        X : array-like of shape (n_recordings, 2)
            Features of the recordings to be shown.
        y : array-like of shape (n_recordings,)
            Their true classes.
        shares, names
            As for the class.
        ax : matplotlib Axes, optional
            Where to draw.

        Returns
        -------
        FeatureDensityDisplay

        Raises
        ------
        TypeError, ValueError
            If there are not two features, or a number is not finite.
        """
        points = plane_points(X, "class densities are")
        means = np.asarray(estimator.means_)
        if means.shape[1] != 2:
            raise ValueError(
                f"class densities are drawn over two features, but the classifier was fitted on "
                f"{means.shape[1]}. Fit it on two of them."
            )
        covariances = np.asarray(estimator.covariances_)
        if estimator.covariance == "diag":
            covariances = covariances[:, np.newaxis] * np.eye(2)
        covariances = np.broadcast_to(covariances, (len(means), 2, 2))
        display = cls(
            list(estimator.classes_), means, covariances, points, y, shares=shares, names=names
        )
        return display.plot(ax=ax)

    def ellipse(self, number: int, share: float) -> NDArray[np.floating]:
        """Return the line that holds a share of the probability of a class.

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
        turn = np.linspace(0, 2 * np.pi, _CORNERS)
        # By eigenvectors and not Cholesky: a class may have no width in some direction.
        powers, axes = np.linalg.eigh(self.covariances[number])
        widths = np.sqrt(np.maximum(powers, 0))
        circle = radius * np.stack([np.cos(turn), np.sin(turn)])
        return self.means[number][:, np.newaxis] + axes @ (widths[:, np.newaxis] * circle)

    def frame(self) -> pd.DataFrame:
        """Return mean, standard deviation and correlation of the features, a row a class."""
        deviations = np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2))
        with np.errstate(divide="ignore", invalid="ignore"):
            correlation = self.covariances[:, 0, 1] / deviations.prod(axis=1)
        table = {f"mean of {name}": self.means[:, i] for i, name in enumerate(self.names)}
        table |= {f"deviation of {name}": deviations[:, i] for i, name in enumerate(self.names)}
        return pd.DataFrame(
            {**table, "correlation": correlation}, index=pd.Index(self.classes, name="class")
        )

    def plot(self, *, ax: Any = None) -> FeatureDensityDisplay:
        """Draw ellipses as lines and recordings as marks.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw. Default: a new figure.

        Returns
        -------
        FeatureDensityDisplay
            Itself.
        """
        ax = one_axes(ax)
        places = {str(name): i for i, name in enumerate(self.classes)}
        draw_recordings(ax, self.points, self.labels, "", places=places)
        for number in range(len(self.classes)):
            for share in self.shares:
                ax.plot(*self.ellipse(number, share), linewidth=1.2, **line_style(number))
        ax.set(xlabel=self.names[0], ylabel=self.names[1])
        legend_beside(ax, **self._legend(ax))
        self.ax_, self.figure_ = ax, ax.figure
        return self

    def _legend(self, ax: Any) -> dict[str, Any]:
        """Join mark and line of a class, and say what the lines hold."""
        if not self.shares:
            return {}
        marks = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
        for number, name in enumerate(map(wrapped, self.classes)):
            (line,) = ax.plot([], [], linewidth=1.2, **line_style(number))
            marks[name] = (line, marks[name]) if name in marks else line
        held = " and ".join(f"{100 * share:.3g}" for share in self.shares)
        title = f"ellipses: {held} % of a class"
        return {"handles": [*marks.values()], "labels": [*marks], "title": title}


def draw_recordings(
    ax: Any,
    points: NDArray[np.floating],
    labels: NDArray[Any],
    prefix: str,
    *,
    places: Mapping[str, int],
) -> None:
    """Draw recordings as marks, one kind a class; `places` numbers the classes known."""
    strangers = len(places)
    for label in np.unique(labels):
        number = places.get(str(label))
        if number is None:
            number, strangers = strangers, strangers + 1
        ax.scatter(
            *points[labels == label].T,
            s=20,
            marker=one_of(MARKERS, number),
            color=colour_of(number) if str(label) in places else "0.3",
            edgecolor="white",
            linewidth=0.4,
            label=wrapped(f"{prefix}{label}"),
            zorder=2,
        )


def plane_points(X: ArrayLike, what: str) -> NDArray[np.floating]:
    """Return the recordings to be drawn, shape (n_recordings, 2).

    Raises
    ------
    TypeError, ValueError
        If there are not two features, no recording, or a number is not finite.
    """
    shape = np.shape(X)
    if len(shape) != 2 or shape[1] != 2:
        raise ValueError(
            f"{what} drawn over two features, got X of shape {shape}. "
            f"Fit the classifier on two of them."
        )
    if not shape[0]:
        raise ValueError("X contains no recording; at least one is needed to place the picture.")
    return check_values(X, "X", (None, 2))


def plane_limits(
    points: NDArray[np.floating],
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the lower and upper limits of a picture of these points, shape (2,) each."""
    low, high = points.min(axis=0), points.max(axis=0)
    width = high - low
    # Points on one line still get a plane around them.
    width = np.where(width > 0, width, np.maximum(1e-9, np.abs(high)))
    return low - _MARGIN * width, high + _MARGIN * width
