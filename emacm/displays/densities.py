"""Recordings in a plane of two features, and the Gaussian density of each class."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_number
from emacm.displays import _drawing, _tables
from emacm.displays._plane import FEATURES, PlaneDisplay, check_classifier, plane_points

_CORNERS = 181  # of the polygon that approximates an ellipse


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
        If shapes do not fit, a value is not finite, or a share is not between 0 and 1.

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
    healthy: Any = field(default=_drawing.HEALTHY, kw_only=True)

    def __post_init__(self) -> None:
        n_classes = len(self.classes)
        self.means = _tables.check_values(self.means, "means", (n_classes, 2))
        self.covariances = _tables.check_values(self.covariances, "covariances", (n_classes, 2, 2))
        self.shares = [check_number(p, "a share", above=0, below=1) for p in self.shares]
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
        points = plane_points(X, "class densities are")
        check_classifier(estimator, "means_", "covariances_")
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
        classes = list(estimator.classes_)
        return cls(classes, means, covariances, points, y, **options).plot(ax=ax)

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
        turn = np.linspace(0, 2 * np.pi, _CORNERS)
        # Eigenvectors, not Cholesky: the covariance of a class may be singular.
        powers, axes = np.linalg.eigh(self.covariances[number])
        widths = np.sqrt(np.maximum(powers, 0))
        circle = radius * np.stack([np.cos(turn), np.sin(turn)])
        return self.means[number][:, np.newaxis] + axes @ (widths[:, np.newaxis] * circle)

    def frame(self) -> pd.DataFrame:
        """Return mean, standard deviation and correlation of the features, one row per class."""
        deviations = np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2))
        with np.errstate(divide="ignore", invalid="ignore"):
            correlation = self.covariances[:, 0, 1] / deviations.prod(axis=1)
        table = {f"mean of {name}": self.means[:, i] for i, name in enumerate(self.names)}
        table |= {f"deviation of {name}": deviations[:, i] for i, name in enumerate(self.names)}
        return pd.DataFrame(
            {**table, "correlation": correlation}, index=pd.Index(self.classes, name="class")
        )

    def _draw(self, ax: Any) -> Any:
        (ax,) = _drawing.panel_axes(ax, height=3.8)
        markers, lines = self._draw_points(ax), {}
        for number, name in enumerate(map(str, self.classes)):
            for share in self.shares:
                style = {"linewidth": 1.2, **_drawing.line_style(self._numbers[name])}
                (lines[name],) = ax.plot(*self.ellipse(number, share), **style)
        held = " and ".join(f"{100 * share:.3g}" for share in self.shares)
        title = f"ellipses: {held} % of a class" if self.shares else ""
        self._name_states(ax, markers, lines, title)
        return ax
