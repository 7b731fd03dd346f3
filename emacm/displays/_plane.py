"""Recordings in a plane of two features, marked by their true state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.validation import check_is_fitted

from emacm.displays import _drawing, _tables
from emacm.displays._display import Display

FEATURES = ("feature 1", "feature 2")
MARGIN = 0.08  # of the range of the recordings, left free around them


class PlaneDisplay(Display):
    """Recordings in a plane of two features."""

    points: Any
    labels: Any
    names: tuple[str, str]
    healthy: Any

    def _check_points(self, states: Sequence[Any]) -> None:
        """Check the recordings; `states` are those that the classifier knows."""
        self.points = _tables.check_values(self.points, "points", (None, 2))
        self.labels = _tables.check_labels(self.labels, len(self.points))
        self._known = [str(state) for state in states]

    @property
    def _numbers(self) -> dict[str, int]:
        """Number of each state of the classifier and of the recordings."""
        return _drawing.state_numbers([*self._known, *np.unique(self.labels)], self.healthy)

    def _draw_points(self, ax: Any) -> dict[str, Any]:
        """Draw the recordings of each state; states unknown to the classifier in grey."""
        truths = np.array([str(label) for label in self.labels])
        return {
            name: ax.scatter(
                *self.points[truths == name].T,
                s=20,
                marker=_drawing.style_of(_drawing.MARKERS, number),
                color=_drawing.colour_of(number) if name in self._known else "0.3",
                edgecolor="white",
                linewidth=0.4,
                zorder=2,
            )
            for name, number in self._numbers.items()
            if name in truths
        }

    def _name_states(
        self, ax: Any, markers: Mapping[str, Any], others: Mapping[str, Any], title: str
    ) -> None:
        """Label the axes, and put a legend above with one entry per state that is drawn."""
        ax.set(xlabel=self.names[0], ylabel=self.names[1])
        handles = {
            name: tuple(each[name] for each in (others, markers) if name in each)
            for name in self._numbers
            if name in markers or name in others
        }
        _drawing.legend_above(ax, handles=[*handles.values()], labels=[*handles], title=title)


def check_classifier(estimator: Any, *attributes: str) -> None:
    """Raise an error if a classifier is not fitted, or lacks the attributes of a Gaussian one."""
    check_is_fitted(estimator)
    missing = [name for name in attributes if not hasattr(estimator, name)]
    if missing:
        raise TypeError(
            f"estimator must be a CostSensitiveGaussianBayes, got {estimator!r}; it has no "
            f"{missing[0]}."
        )


def plane_points(X: ArrayLike, what: str) -> NDArray[np.floating]:
    """Return the recordings to be drawn, shape (n_recordings, 2).

    Raises
    ------
    TypeError, ValueError
        If there are not two features, no recording, or a value is not finite.
    """
    shape = np.shape(X)
    if len(shape) != 2 or shape[1] != 2:
        raise ValueError(
            f"{what} drawn over two features, got X of shape {shape}. "
            f"Fit the classifier on two of them."
        )
    if not shape[0]:
        raise ValueError(
            "X contains no recording; at least one is needed for the limits of the axes."
        )
    return _tables.check_values(X, "X", (None, 2))


def plane_limits(
    points: NDArray[np.floating], margin: float = MARGIN
) -> tuple[NDArray[np.floating], ...]:
    """Return the lower and upper limits of the plane around these points, shape (2,) each."""
    low, high = points.min(axis=0), points.max(axis=0)
    width = high - low
    # Points on a line still have a plane around them.
    width = np.where(width > 0, width, np.maximum(1e-9, np.abs(high)))
    return low - margin * width, high + margin * width
