"""Reliability of posterior probabilities: observed frequency over confidence, and counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from emacm.displays import _drawing, _tables
from emacm.displays._display import Display
from emacm.evaluation.results import Evaluation

CURVE = ("confidence", "frequency", "low", "high", "count")
_EDGES = ("from", "to")
_PALETTE = (2, 1, 3, 5, 4)  # numbers of colours; the first is not that of the healthy state
_TALL = 3  # height of the curves over that of the counts
_LEAST = 0.5  # lower end of the bars of counts


@dataclass(eq=False, repr=False)
class ReliabilityDisplay(Display):
    """Observed frequency of correct classes over the confidence, and the number of recordings.

    Confidence is the highest posterior probability of a recording. Points on the diagonal are
    calibrated; below it the classifier is over-confident.

    Parameters
    ----------
    curves : mapping of str to DataFrame
        For each name one row for each bin of confidence: its edges "from" and "to", mean
        "confidence", "frequency" at which the most probable class is the true one, with its
        interval "low" to "high" (may be NaN), and "count" of recordings.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (2,)
        Set when the display is drawn: the curves, and the counts.
    figure_ : Figure
        Figure of these Axes.

    Raises
    ------
    TypeError, ValueError
        If there is no curve, a column is missing, or a value is negative or not finite.

    Examples
    --------
    >>> import pandas as pd
    >>> curve = pd.DataFrame(
    ...     {"from": [0.5, 0.9], "to": [0.6, 1.0], "confidence": [0.55, 0.95],
    ...      "frequency": [0.5, 1.0], "low": [0.2, 0.9], "high": [0.8, 1.0], "count": [10, 30]}
    ... )
    >>> display = ReliabilityDisplay({"by run": curve})
    >>> round(display.calibration_error("by run"), 3)
    0.05
    """

    curves: Mapping[str, pd.DataFrame]

    def __post_init__(self) -> None:
        if not isinstance(self.curves, Mapping) or not self.curves:
            raise TypeError(
                f"curves must map at least one name to a reliability curve, got {self.curves!r}."
            )
        for name, curve in self.curves.items():
            check_curve(curve, f"the curve {name!r}", (*_EDGES, *CURVE))

    @classmethod
    def from_evaluation(
        cls, evaluation: Evaluation, *, schemes: str | Sequence[str] | None = None, ax: Any = None
    ) -> ReliabilityDisplay:
        """Draw the reliability of one or several hold-out schemes.

        Parameters
        ----------
        evaluation : Evaluation
            Result of `emacm.evaluation.evaluate.evaluate`.
        schemes : str or sequence of str, optional
            Schemes to draw. Default: the second of those that were scored (the first after the
            random split), or the only one.
        ax : sequence of matplotlib Axes, optional
            Two Axes.

        Returns
        -------
        ReliabilityDisplay

        Raises
        ------
        TypeError, ValueError
            If `evaluation` is not such a result, has no probabilities, or has no such scheme.
        """
        scored = list(_curves_of(evaluation))
        if schemes is None:
            schemes = scored[min(1, len(scored) - 1)]
        names = [schemes] if isinstance(schemes, str) else list(schemes)
        curves = {name: _curves_of(evaluation, name)[name] for name in names}
        return cls(curves).plot(ax=ax)

    @classmethod
    def from_evaluations(
        cls, evaluations: Mapping[str, Evaluation], *, scheme: str, ax: Any = None
    ) -> ReliabilityDisplay:
        """Draw the reliability of several evaluations, such as with and without a temperature.

        Parameters
        ----------
        evaluations : mapping of str to Evaluation
            Results of `emacm.evaluation.evaluate.evaluate`, by name.
        scheme : str
            Hold-out scheme.
        ax : sequence of matplotlib Axes, optional
            Two Axes.

        Returns
        -------
        ReliabilityDisplay

        Raises
        ------
        TypeError, ValueError
            As `from_evaluation`.
        """
        curves = {name: _curves_of(each, scheme)[scheme] for name, each in evaluations.items()}
        return cls(curves).plot(ax=ax)

    def calibration_error(self, name: str) -> float:
        """Return the mean difference of confidence and frequency of a curve, by recordings."""
        curve = self.curves[name]
        gaps = (curve["confidence"] - curve["frequency"]).abs() * curve["count"]
        return float(gaps.sum() / curve["count"].sum())

    def frame(self) -> pd.DataFrame:
        """Return all curves, with their names in the column "curve"."""
        parts = [curve.assign(curve=name) for name, curve in self.curves.items()]
        frame = pd.concat(parts, ignore_index=True)
        return frame[["curve", *_EDGES, *CURVE]]

    def _draw(self, ax: Any) -> Any:
        if ax is None:
            size = (_drawing.WIDTH, 4.6)
            figure = _drawing.pyplot().figure(figsize=size, layout="constrained")
            ax = figure.subplots(2, sharex=True, height_ratios=[_TALL, 1])
        upper, lower = axes = _drawing.panel_axes(ax, 2)
        upper.plot([0, 100], [0, 100], color="0.5", linestyle="--", linewidth=1, label="calibrated")
        for number, (name, curve) in enumerate(self.curves.items()):
            colour = _drawing.COLOURS[_PALETTE[number % len(_PALETTE)]]
            marker = _drawing.style_of(_drawing.MARKERS, number)
            label = f"{name}: calibration error {self.calibration_error(name):.3f}"
            draw_curve(upper, curve, colour, label=_drawing.wrapped(label), marker=marker)
            self._draw_counts(lower, number, colour)
        upper.set(xlim=(-2, 102), ylim=(-2, 102))
        upper.grid(color="0.9", linewidth=0.6)
        _drawing.label_y(upper, "observed frequency", "%")
        lower.set_xlim(-2, 102)
        lower.set_yscale("log")
        largest = max(curve["count"].max() for curve in self.curves.values())
        lower.set_ylim(_LEAST, largest ** (1.3 if len(self.curves) == 1 else 1.7) * 2)
        lower.set_yticks([], minor=False)  # the numbers are written
        lower.set_yticks([], minor=True)
        lower.set_ylabel("recordings")
        lower.set_xlabel("confidence (highest posterior) [%]")
        _drawing.legend_above(upper, title="line: confidence interval")
        return axes

    def _draw_counts(self, panel: Any, number: int, colour: str) -> None:
        """Draw the number of recordings in each bin, the bars of several curves side by side."""
        curve = list(self.curves.values())[number]
        left, right = (100 * curve[edge].to_numpy(float) for edge in _EDGES)
        width = (right - left) / len(self.curves)
        counts = curve["count"].to_numpy(float)
        bars = panel.bar(
            left + number * width,
            counts - _LEAST,
            width,
            bottom=_LEAST,
            align="edge",
            color=_drawing.tint(colour, 0.6),
            edgecolor="black",
            linewidth=0.5,
        )
        turned = {"rotation": 90} if len(self.curves) > 1 else {}
        style = {"fontsize": _drawing.SMALL, "padding": 1.5, **turned}
        panel.bar_label(bars, [f"{count:g}" for count in counts], **style)


def draw_curve(panel: Any, curve: pd.DataFrame, colour: str, **style: Any) -> None:
    """Draw frequency over confidence in per cent, with the intervals as vertical lines."""
    confidence, frequency, low, high = 100 * curve[list(CURVE[:4])].to_numpy(float).T
    panel.vlines(confidence, low, high, color=colour, linewidth=1.4)
    look = {"marker": "o", "markersize": 5} | style
    panel.plot(confidence, frequency, "-", color=colour, linewidth=0.8, **look)


def check_curve(curve: Any, name: str, columns: Sequence[str] = CURVE) -> None:
    """Check a reliability curve.

    Raises
    ------
    ValueError
        If a column is missing, or a value is negative or not finite.
    """
    missing = [column for column in columns if column not in getattr(curve, "columns", ())]
    if missing:
        raise ValueError(f"{name} must have the columns {list(columns)}; it has no {missing}.")
    _tables.check_values(curve[["confidence", "frequency", "count"]], name, (None, 3), least=0)


def _curves_of(evaluation: Any, scheme: str | None = None) -> dict[str, pd.DataFrame]:
    """Return the reliability curves of an evaluation by scheme."""
    if not isinstance(evaluation, Evaluation):
        raise TypeError(
            f"evaluation must be the result of evaluate, got {type(evaluation).__name__}."
        )
    table = evaluation.calibration
    if table.empty:
        raise ValueError("evaluation has no probabilities; the classifier has no predict_proba.")
    curves = {str(name): part for name, part in table.groupby("scheme", sort=False)}
    if scheme is not None and scheme not in curves:
        raise ValueError(f"scheme must be one that was scored: {list(curves)}; got {scheme!r}.")
    return curves
