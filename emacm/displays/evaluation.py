"""Pictures of evaluations: ways of holding out beside each other, confusion, reliability."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from emacm.displays._drawing import (
    COLOURS,
    MARKERS,
    SMALL,
    colour_of,
    label_axes,
    one_of,
    panels_beside,
    tint,
    wrapped,
)
from emacm.displays._tables import check_values
from emacm.evaluation.results import Evaluation

# Share, and what it is called in the legend.
SHARES = {
    "balanced_accuracy": "balanced accuracy",
    "accuracy": "accuracy",
    "false_alarm_rate": "false alarms",
    "inspection_rate": "inspections",
    "missed_detection_rate": "missed detections",
}
_SHOWN = ("balanced_accuracy", "false_alarm_rate", "inspection_rate", "missed_detection_rate")
_LINE = 0.22  # inches for each figure of a scheme
_CELL = (0.42, 0.42)  # inches of a cell of the confusion
_DARK = 0.55  # share of a column above which its number is written in white
_CURVE = ("confidence", "frequency", "low", "high", "count")


class EvaluationDisplay:
    """Figures by scheme with their limits, the confusion of one scheme, and its reliability.

    Parameters
    ----------
    table : DataFrame
        A row for each way of holding out; columns ``balanced_accuracy``,
        ``balanced_accuracy_low``, ``balanced_accuracy_high`` and so on, shares 0..1, NaN where
        they are not known.
    confusion : DataFrame
        Counts: rows are what was decided (families, if there are any), columns the true classes.
    calibration : DataFrame, optional
        A row for each bin of stated probability: "confidence", "frequency", "low", "high" (may be
        NaN) and "count". Without any there is no third panel.
    scheme : str
        What `confusion` and `calibration` are of.
    figures : sequence of str, optional
        Which shares are drawn, among "balanced_accuracy", "accuracy", "false_alarm_rate",
        "inspection_rate" and "missed_detection_rate". Default: all but "accuracy", as far
        as `table` has them.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (2,) or (3,)
        What was drawn on, once `plot` has run.
    figure_ : Figure
        The figure of `ax_`.

    Raises
    ------
    TypeError, ValueError
        If a table lacks a column, or holds what is no share or count.

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

    ax_: Any
    figure_: Any

    def __init__(
        self,
        table: pd.DataFrame,
        confusion: pd.DataFrame,
        calibration: pd.DataFrame | None = None,
        *,
        scheme: str = "",
        figures: Sequence[str] | None = None,
    ) -> None:
        for name, given in (("table", table), ("confusion", confusion)):
            if not isinstance(given, pd.DataFrame) or given.empty:
                raise TypeError(f"{name} must be a DataFrame that is not empty, got {given!r}.")
        self.figures = _checked_figures(table, figures)
        columns = [f"{name}{end}" for name in self.figures for end in ("", "_low", "_high")]
        known = table[columns].to_numpy(float)
        if not np.isfinite(known).any() or (known < 0).any() or (known > 1).any():
            raise ValueError(
                f"table must hold shares from 0 to 1 in {columns}, and one at the least; got "
                f"{known.tolist()}."
            )
        check_values(confusion, "confusion", (None, None), least=0)
        self.table, self.confusion, self.scheme = table, confusion, scheme
        self.calibration = None if calibration is None else _checked_curve(calibration)

    @classmethod
    def from_evaluation(
        cls,
        evaluation: Evaluation,
        *,
        scheme: str | None = None,
        figures: Sequence[str] | None = None,
        ax: Any = None,
    ) -> EvaluationDisplay:
        """Draw what `evaluate` found.

        Parameters
        ----------
        evaluation : Evaluation
            Result of `emacm.evaluation.evaluate.evaluate`.
        scheme : str, optional
            Whose confusion and reliability are drawn. Default: the second of those that were
            scored (the first beside the random split); the only one, if there is no second.
        figures : sequence of str, optional
            As for the class.
        ax : sequence of matplotlib Axes, optional
            Where to draw: two, or three if there are probabilities.

        Returns
        -------
        EvaluationDisplay

        Raises
        ------
        TypeError
            If `evaluation` is another thing.
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
        display = cls(evaluation.table, confusion, curve, scheme=chosen, figures=figures)
        return display.plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the numbers: a row for each scheme and figure, with its limits."""
        rows = [
            (scheme, figure, *row[[figure, f"{figure}_low", f"{figure}_high"]])
            for scheme, row in self.table.iterrows()
            for figure in self.figures
        ]
        return pd.DataFrame(rows, columns=["scheme", "figure", "value", "low", "high"])

    def plot(self, *, ax: Any = None) -> EvaluationDisplay:
        """Draw the schemes, the confusion, and the reliability if it is known.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, optional
            Where to draw: two, or three with a calibration. Default: a new figure.

        Returns
        -------
        EvaluationDisplay
            Itself.
        """
        n_rows, n_columns = self.confusion.shape
        lines = len(self.table) * (len(self.figures) + 1)
        widths = [4.8, 1.8 + max(2.0, _CELL[0] * n_columns)]
        if self.calibration is not None:
            widths.append(3.6)
        height = max(3.6, 1.6 + _CELL[1] * n_rows, 1.3 + _LINE * lines)
        axes = panels_beside(ax, widths, height=height)
        self._draw_figures(axes[0])
        self._draw_confusion(axes[1])
        if self.calibration is not None:
            self._draw_reliability(axes[2])
        self.ax_, self.figure_ = axes, axes[0].figure
        return self

    def _draw_figures(self, panel: Any) -> None:
        frame, n_figures = self.frame(), len(self.figures)
        heights = np.arange(len(self.table))
        for number, name in enumerate(self.figures):
            part = frame[frame["figure"] == name]
            value, low, high = (100 * part[c].to_numpy(float) for c in ("value", "low", "high"))
            places = heights + (number - (n_figures - 1) / 2) * 0.6 / n_figures
            look = {"color": colour_of(number), "zorder": 3}
            panel.hlines(places, low, high, linewidth=1.6, **look)
            panel.plot(value, places, one_of(MARKERS, number), label=SHARES[name], **look)
        for height in heights[frame.groupby("scheme", sort=False)["value"].count() == 0]:
            panel.text(50, height, "cannot be scored", ha="center", va="center", fontsize=SMALL)
        panel.set_yticks(heights, [self._named(name) for name in self.table.index])
        panel.tick_params(axis="y", labelsize=SMALL, length=0)
        panel.set_ylim(len(heights) - 0.5, -0.5)  # the first on top
        panel.set_xlim(-2, 102)
        panel.grid(axis="x", color="0.9", linewidth=0.6)
        for height in heights[1:] - 0.5:
            panel.axhline(height, color="0.8", linewidth=0.6)
        label_axes(panel, "share of the recordings [%]", "")
        above = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.01), "ncols": n_figures}
        panel.legend(fontsize=SMALL, frameon=False, columnspacing=1.0, **above)

    def _named(self, scheme: Any) -> str:
        row = self.table.loc[scheme]
        if not row.get("groups") or "resampled" not in row:
            return wrapped(scheme)
        return f"{wrapped(scheme)}\n({row['resampled']}s: {row['groups']})"

    def _draw_confusion(self, panel: Any) -> None:
        from matplotlib.colors import LinearSegmentedColormap

        counts = self.confusion.to_numpy(float)
        below = counts.sum(axis=0)
        shares = counts / np.where(below > 0, below, 1)
        ramp = LinearSegmentedColormap.from_list("shares", ["white", tint(COLOURS[0], 1.0)])
        panel.imshow(shares, cmap=ramp, vmin=0, vmax=1, aspect="auto")
        for (row, column), count in np.ndenumerate(counts):
            if count:
                ink = "white" if shares[row, column] > _DARK else "black"
                text = {"ha": "center", "va": "center", "fontsize": SMALL}
                panel.text(column, row, f"{count:g}", color=ink, **text)
        upright = max(len(str(name)) for name in self.confusion.columns) > 5
        places, style = np.arange(counts.shape[1]), {"fontsize": SMALL}
        turned = {"rotation": 40, "ha": "right", "rotation_mode": "anchor"} if upright else {}
        panel.set_xticks(places, [str(c) for c in self.confusion.columns], **style, **turned)
        panel.set_yticks(
            np.arange(len(counts)), [wrapped(r) for r in self.confusion.index], **style
        )
        panel.tick_params(length=0)
        label_axes(panel, "true", "decided")
        title = f"{self.scheme}: " if self.scheme else ""
        panel.set_title(f"{title}recordings, shaded by\nthe share of each true class", fontsize=9)

    def _draw_reliability(self, panel: Any) -> None:
        curve = self.calibration
        assert curve is not None
        stated, true = (100 * curve[name].to_numpy(float) for name in ("confidence", "frequency"))
        low, high = (100 * curve[name].to_numpy(float) for name in ("low", "high"))
        panel.plot([0, 100], [0, 100], color="0.5", linestyle="--", linewidth=1)
        panel.vlines(stated, low, high, color=COLOURS[0], linewidth=1.2)
        panel.plot(stated, true, "-", color=COLOURS[0], linewidth=0.8)
        sizes = 12 + 90 * curve["count"].to_numpy(float) / curve["count"].sum()
        panel.scatter(stated, true, sizes, color=COLOURS[0], zorder=3)
        panel.set_xlim(-2, 102)
        panel.set_ylim(-2, 102)
        label_axes(panel, "probability of the most probable [%]", "share that came true [%]")
        title = f"{self.scheme}: " if self.scheme else ""
        panel.set_title(f"{title}reliability\n(area: number of recordings)", fontsize=9)


def _checked_figures(table: pd.DataFrame, figures: Sequence[str] | None) -> list[str]:
    if figures is None:
        figures = [name for name in _SHOWN if name in table] or ["accuracy"]
    names = [figures] if isinstance(figures, str) else list(figures)
    columns = [f"{name}{end}" for name in names for end in ("", "_low", "_high")]
    missing = [column for column in columns if column not in table]
    if not names or missing or not set(names) <= set(SHARES):
        raise ValueError(
            f"figures must be among {list(SHARES)}, with limits in table; got {names}"
            + (f", and the table lacks {missing}." if missing else ".")
        )
    return names


def _checked_curve(calibration: pd.DataFrame) -> pd.DataFrame:
    missing = [name for name in _CURVE if name not in getattr(calibration, "columns", ())]
    if missing:
        raise ValueError(f"calibration must have the columns {list(_CURVE)}; it lacks {missing}.")
    check_values(
        calibration[["confidence", "frequency", "count"]], "calibration", (None, 3), least=0
    )
    return calibration
