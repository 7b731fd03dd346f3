"""ROC curves of unknown states: families of faults that were left out of training."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.metrics import roc_auc_score, roc_curve

from emacm.displays import _drawing, _tables
from emacm.displays._display import Display
from emacm.displays.typicality import left_out_predictions
from emacm.evaluation.novelty import FLAGGED
from emacm.evaluation.results import Evaluation

_COLUMNS = ("left_out", "typicality", "is_unknown")


@dataclass(eq=False, repr=False)
class UnknownRocDisplay(Display):
    """Fraction of unknown recordings that are flagged over that of known ones.

    A recording is flagged if its typicality is at most a threshold; the curve is over all
    thresholds, the marker at `threshold`.

    Parameters
    ----------
    table : DataFrame
        One row for each family left out of training and recording: "left_out" (name of the
        family), "typicality" (0 to 1) and "is_unknown" (whether the recording is of this family).
    intervals : DataFrame, optional
        Rows named by the families; columns "auroc_low" and "auroc_high", for the legend.
    threshold : float
        Typicality of the marker.

    Attributes
    ----------
    ax_, figure_
        Axes and figure, set when the display is drawn.

    Raises
    ------
    TypeError, ValueError
        If a column is missing, a value is not finite, or a family has no known or no unknown
        recording.

    Examples
    --------
    >>> import pandas as pd
    >>> table = pd.DataFrame(
    ...     {"left_out": "worn", "typicality": [0.6, 0.004, 0.1, 0.002],
    ...      "is_unknown": [False, False, True, True]}
    ... )
    >>> UnknownRocDisplay(table).areas()
    {'worn': 0.75}
    """

    table: pd.DataFrame
    intervals: pd.DataFrame | None = None
    threshold: float = field(default=FLAGGED, kw_only=True)

    def __post_init__(self) -> None:
        missing = [name for name in _COLUMNS if name not in getattr(self.table, "columns", ())]
        if missing:
            raise ValueError(f"table must have the columns {list(_COLUMNS)}; it has no {missing}.")
        _tables.check_values(self.table["typicality"], "typicality", (None,), least=0)
        for family, part in self.table.groupby("left_out", sort=False):
            if part["is_unknown"].nunique() < 2:
                raise ValueError(
                    f"table must have known and unknown recordings of each family left out; "
                    f"{family!r} has {int(part['is_unknown'].sum())} unknown of {len(part)}."
                )

    @classmethod
    def from_evaluation(
        cls, evaluation: Evaluation, *, ax: Any = None, **options: Any
    ) -> UnknownRocDisplay:
        """Draw the families of faults that an evaluation left out of training.

        Parameters
        ----------
        evaluation : Evaluation
            Result of `emacm.evaluation.evaluate.evaluate` for a classifier with an unknown state.
        ax : matplotlib Axes, optional
            Where to draw.
        **options
            As for the class: threshold.

        Returns
        -------
        UnknownRocDisplay

        Raises
        ------
        TypeError, ValueError
            If `evaluation` is not such a result, or no family was left out.
        """
        table = left_out_predictions(evaluation)
        return cls(table[[*_COLUMNS]], evaluation.novelty, **options).plot(ax=ax)

    def areas(self) -> dict[str, float]:
        """Return the area under the ROC curve of each family."""
        return {
            str(family): float(roc_auc_score(part["is_unknown"], -part["typicality"]))
            for family, part in self.table.groupby("left_out", sort=False)
        }

    def frame(self) -> pd.DataFrame:
        """Return the curves: "left_out", fractions "known_flagged", "unknown_flagged", threshold.

        A recording is flagged if its typicality is at most the "threshold".
        """
        parts = []
        for family, part in self.table.groupby("left_out", sort=False):
            # Thresholds of scikit-learn start above all scores, which flags no recording.
            known, unknown, scores = roc_curve(part["is_unknown"], -part["typicality"])
            columns = {"known_flagged": known, "unknown_flagged": unknown}
            levels = np.where(np.isfinite(scores), -scores, 0.0)
            parts.append(pd.DataFrame({"left_out": family, **columns, "threshold": levels}))
        return pd.concat(parts, ignore_index=True)

    def _draw(self, ax: Any) -> Any:
        (ax,) = _drawing.panel_axes(ax, height=3.6)
        ax.plot([0, 100], [0, 100], color="0.6", linestyle=(0, (1, 2)), linewidth=1)
        areas, frame = self.areas(), self.frame()
        numbers = {name: n for n, name in enumerate(sorted(areas), 1)}  # 0 is the healthy state
        for family, curve in frame.groupby("left_out", sort=False):
            number = numbers[str(family)]
            style = _drawing.line_style(number)
            x, y = 100 * curve[["known_flagged", "unknown_flagged"]].to_numpy().T
            label = f"{family}: AUROC {areas[str(family)]:.3f}{self._limits(family)}"
            ax.plot(x, y, label=label, linewidth=1.6, **style)
            point = 100 * self._at_threshold(family)
            marker = _drawing.style_of(_drawing.MARKERS, number)
            ax.plot(*point, marker, color=style["color"], markeredgecolor="black", zorder=3)
        ax.plot([], [], "o", color="white", markeredgecolor="black", label=self._threshold_text)
        ax.set(xlim=(-2, 102), ylim=(-2, 102))
        ax.grid(color="0.9", linewidth=0.6)
        _drawing.label_axes(ax, "known recordings flagged [%]", "unknown recordings flagged [%]")
        _drawing.legend_above(ax, title="family left out of training")
        return ax

    @property
    def _threshold_text(self) -> str:
        return f"flagged at typicality ≤ {self.threshold:g}"

    def _limits(self, family: Any) -> str:
        if self.intervals is None or family not in self.intervals.index:
            return ""
        low, high = self.intervals.loc[family, ["auroc_low", "auroc_high"]]
        return "" if np.isnan(low) else f" ({low:.3f} to {high:.3f})"

    def _at_threshold(self, family: Any) -> NDArray[np.float64]:
        """Return the fractions of known and unknown recordings flagged at the threshold."""
        part = self.table[self.table["left_out"] == family]
        flagged = (part["typicality"] <= self.threshold).to_numpy(float)
        is_unknown = part["is_unknown"].to_numpy(bool)
        return np.array([flagged[~is_unknown].mean(), flagged[is_unknown].mean()])
