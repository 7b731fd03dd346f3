"""Results of an evaluation: rates by hold-out scheme, confusion matrix, reliability."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from emacm.displays import _drawing, _tables
from emacm.displays._display import Display
from emacm.displays._rates import CENTRED, INCHES, checked_rates, draw_rates, rate_frame
from emacm.displays.reliability import check_curve, draw_curve
from emacm.evaluation.results import Evaluation

_CELL = 0.26  # inches for each row of the confusion matrix
_BESIDE = 6  # classes up to which the reliability is drawn beside the confusion matrix
_DARK = 0.55  # share of a column above which its count is written in white


@dataclass(eq=False, repr=False)
class EvaluationDisplay(Display):
    """Rates by hold-out scheme with their intervals, confusion matrix, and reliability.

    Parameters
    ----------
    table : DataFrame
        One row for each hold-out scheme; columns ``balanced_accuracy``,
        ``balanced_accuracy_low``, ``balanced_accuracy_high`` and so on, from 0 to 1, NaN where
        they are not known.
    confusion : DataFrame
        Counts: rows are the decisions (families, if there are any), columns the true classes.
    calibration : DataFrame, optional
        One row for each bin of confidence (the highest posterior probability): "confidence" and
        "frequency" (the fraction of correct decisions) with its interval "low" to "high" (may be
        NaN), and "count". Without it there is no third panel.
    scheme : str
        Scheme of `confusion` and `calibration`.
    figures : sequence of str, optional
        Rates to draw, among "balanced_accuracy", "accuracy", "false_alarm_rate",
        "inspection_rate" and "missed_detection_rate". Default: all but "accuracy", as far as
        `table` has them.
    healthy : str
        The healthy class: first row and column of the confusion matrix.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (2,) or (3,)
        Set when the display is drawn.
    figure_ : Figure
        Figure of these Axes.

    Raises
    ------
    TypeError, ValueError
        If a column is missing, or a value is not a rate or a count.

    Examples
    --------
    >>> import pandas as pd
    >>> table = pd.DataFrame(
    ...     {"accuracy": [0.9], "accuracy_low": [0.8], "accuracy_high": [0.95]}, index=["by run"]
    ... )
    >>> confusion = pd.DataFrame([[9, 1], [1, 9]], index=["new", "worn"], columns=["new", "worn"])
    >>> EvaluationDisplay(table, confusion, figures=["accuracy"]).frame()
       scheme    figure  value  low  high
    0  by run  accuracy    0.9  0.8  0.95
    """

    table: pd.DataFrame
    confusion: pd.DataFrame
    calibration: pd.DataFrame | None = None
    scheme: str = field(default="", kw_only=True)
    figures: Any = field(default=None, kw_only=True)
    healthy: Any = field(default=_drawing.HEALTHY, kw_only=True)

    def __post_init__(self) -> None:
        for name, given in (("table", self.table), ("confusion", self.confusion)):
            if not isinstance(given, pd.DataFrame) or given.empty:
                raise TypeError(f"{name} must be a DataFrame that is not empty, got {given!r}.")
        self.figures = checked_rates(self.table, self.figures)
        _tables.check_values(self.confusion, "confusion", (None, None), least=0)
        rows, classes = (
            sorted(names, key=lambda name: str(name) != str(self.healthy))
            for names in (self.confusion.index, self.confusion.columns)
        )
        self.confusion = self.confusion.loc[rows, classes]
        if self.calibration is not None:
            check_curve(self.calibration, "calibration")

    @classmethod
    def from_evaluation(
        cls,
        evaluation: Evaluation,
        *,
        scheme: str | None = None,
        ax: Any = None,
        **options: Any,
    ) -> EvaluationDisplay:
        """Draw the result of `evaluate`.

        Parameters
        ----------
        evaluation : Evaluation
            Result of `emacm.evaluation.evaluate.evaluate`.
        scheme : str, optional
            Scheme of the confusion matrix and the reliability. Default: the second of those that
            were scored (the first after the random split), or the only one.
        ax : sequence of matplotlib Axes, optional
            Where to draw: two Axes, or three if there are probabilities.
        **options
            As for the class: figures, healthy. Default of `healthy`: that of the evaluation.

        Returns
        -------
        EvaluationDisplay

        Raises
        ------
        TypeError
            If `evaluation` is not such a result.
        ValueError
            If `scheme` was not scored.
        """
        if not isinstance(evaluation, Evaluation):
            raise TypeError(
                f"evaluation must be the result of evaluate, got {type(evaluation).__name__}."
            )
        scored = list(evaluation.confusions)
        if not scored or (scheme is not None and scheme not in scored):
            raise ValueError(f"scheme must be one that was scored: {scored}; got {scheme!r}.")
        chosen = scored[min(1, len(scored) - 1)] if scheme is None else scheme
        curve = evaluation.calibration
        curve = curve[curve["scheme"] == chosen] if len(curve) else None
        confusion = evaluation.confusions[chosen]
        if evaluation.scoring.healthy is not None:
            options.setdefault("healthy", evaluation.scoring.healthy)
        return cls(evaluation.table, confusion, curve, scheme=chosen, **options).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the rates: one row per scheme and rate, with its interval."""
        return rate_frame(self.table, self.figures, "scheme")

    def _draw(self, ax: Any) -> Any:
        n_panels = 2 if self.calibration is None else 3
        axes = self._panels() if ax is None else _drawing.panel_axes(ax, n_panels)
        draw_rates(axes[0], self.table, self.figures)
        self._draw_confusion(axes[1])
        if self.calibration is not None:
            self._draw_reliability(axes[2])
        return axes

    def _panels(self) -> Any:
        """Return the Axes of a new figure: rates above, confusion and reliability below."""
        n_rows, n_columns = self.confusion.shape
        rates = 1.0 + INCHES * len(self.table) * (len(self.figures) + 1)
        heights = [rates, max(2.4, 1.3 + _CELL * n_rows)]
        panels = [["rates"], ["confusion"]]
        if self.calibration is not None and n_columns <= _BESIDE:
            panels = [["rates"] * 2, ["confusion", "reliability"]]
        elif self.calibration is not None:
            panels, heights = [*panels, ["reliability"]], [*heights, 3.0]
        size = (_drawing.WIDTH, sum(heights))
        figure = _drawing.pyplot().figure(figsize=size, layout="constrained")
        return np.array([*figure.subplot_mosaic(panels, height_ratios=heights).values()])

    def _draw_confusion(self, panel: Any) -> None:
        from matplotlib.colors import LinearSegmentedColormap

        counts = self.confusion.to_numpy(float)
        below = counts.sum(axis=0)
        shares = counts / np.where(below > 0, below, 1)
        ramp = LinearSegmentedColormap.from_list("shares", ["white", _drawing.PLAIN])
        panel.imshow(shares, cmap=ramp, vmin=0, vmax=1, aspect="auto")
        for (row, column), count in np.ndenumerate(counts):
            if count:
                ink = "white" if shares[row, column] > _DARK else "black"
                panel.text(column, row, f"{count:g}", color=ink, **CENTRED)
        upright = max(len(str(name)) for name in self.confusion.columns) > 5
        turned = {"rotation": 40, "ha": "right", "rotation_mode": "anchor"} if upright else {}
        style = {"fontsize": _drawing.SMALL}
        panel.set_xticks(range(counts.shape[1]), self.confusion.columns, **style, **turned)
        rows = [_drawing.wrapped(name) for name in self.confusion.index]
        panel.set_yticks(range(len(counts)), rows, **style)
        panel.tick_params(length=0)
        _drawing.label_axes(panel, "true class", "decision")
        self._title(panel, "recordings, shaded by\nthe share of each true class")

    def _draw_reliability(self, panel: Any) -> None:
        curve = self.calibration
        assert curve is not None
        panel.plot([0, 100], [0, 100], color="0.5", linestyle="--", linewidth=1)
        draw_curve(panel, curve, _drawing.PLAIN, marker="")
        sizes = 12 + 90 * curve["count"].to_numpy(float) / curve["count"].sum()
        points = 100 * curve[["confidence", "frequency"]].to_numpy(float)
        panel.scatter(*points.T, sizes, color=_drawing.PLAIN, zorder=3)
        panel.set(xlim=(-2, 102), ylim=(-2, 102))
        panel.set_xlabel("confidence [%]")
        _drawing.label_y(panel, "observed frequency", "%")
        self._title(panel, "reliability\n(area: number of recordings)")

    def _title(self, panel: Any, text: str) -> None:
        scheme = f"{self.scheme}: " if self.scheme else ""
        panel.set_title(f"{scheme}{text}", fontsize=_drawing.SMALL)
