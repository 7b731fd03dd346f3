"""Outcomes of decisions: correct, false alarm, inspection, wrong fault, missed detection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from emacm.decisions.truths import label_list
from emacm.displays import _drawing, _tables
from emacm.displays._drawing import Display

# Colour and hatch of each outcome; the darker in print, the more serious.
OUTCOMES = {
    "correct": (_drawing.tint(_drawing.COLOURS[2], 0.25), ""),
    "inspection": ("#ffffff", "...."),
    "false alarm": (_drawing.tint(_drawing.COLOURS[4], 0.75), "////"),
    "wrong fault": (_drawing.tint(_drawing.COLOURS[3], 0.9), "----"),
    "missed detection": (_drawing.COLOURS[1], "xxxx"),
}


@dataclass(eq=False, repr=False)
class OutcomesDisplay(Display):
    """Outcomes of decisions in per cent, by operating condition, one panel for each signal.

    Parameters
    ----------
    counts : DataFrame
        Number of recordings with each outcome, or their shares. Columns are among "correct",
        "inspection" (the decision is neither healthy nor a fault), "false alarm" (healthy, decided
        to be faulty), "wrong fault" (faulty, decided to be another fault) and "missed detection"
        (faulty, decided to be healthy). The index names conditions, or signals and conditions.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (n_signals,)
        Set when the display is drawn.
    figure_ : Figure
        Figure of these Axes.

    Raises
    ------
    TypeError, ValueError
        If a column is not an outcome, or there is no row.

    Notes
    -----
    Source of this kind of figure: Chirico, section 4.4 (Figs. 4.65 to 4.72), where a false alarm
    is called false positive and a missed detection false negative. A "wrong fault" needs more than
    two classes, an "inspection" a decision that is not a class.

    Examples
    --------
    >>> import pandas as pd
    >>> counts = pd.DataFrame(
    ...     {"correct": [17, 20], "missed detection": [3, 0]}, index=["condition 1", "condition 2"]
    ... )
    >>> OutcomesDisplay(counts).frame()[["correct", "missed detection", "n"]]
                 correct  missed detection     n
    condition 1     85.0              15.0  20.0
    condition 2    100.0               0.0  20.0
    """

    counts: pd.DataFrame

    def __post_init__(self) -> None:
        counts = self.counts
        if not len(counts) or not set(counts.columns) <= set(OUTCOMES):
            raise ValueError(
                f"counts must have columns among {list(OUTCOMES)} and at least one row; got "
                f"{list(counts.columns)} and {len(counts)} rows."
            )
        self.counts = counts.reindex(columns=list(OUTCOMES), fill_value=0).astype(float)

    @classmethod
    def from_predictions(
        cls,
        y_true: ArrayLike,
        y_pred: ArrayLike,
        *,
        healthy: Any,
        classes: Sequence[Any] | None = None,
        conditions: ArrayLike | None = None,
        ax: Any = None,
    ) -> OutcomesDisplay:
        """Count the outcomes of decisions, and draw them.

        Parameters
        ----------
        y_true : array-like of shape (n_recordings,)
            True classes; of a classifier of families, those of `as_families`.
        y_pred : array-like of shape (n_recordings,)
            Decisions. One that is no class, such as "inspect", is an inspection.
        healthy : str
            The healthy class.
        classes : sequence, optional
            Classes that can be decided, such as ``model.classes_``. Default: those of `y_true`.
        conditions : array-like of shape (n_recordings,), optional
            Operating condition of each recording. Default: a single row.
        ax : matplotlib Axes, optional
            Where to draw.

        Returns
        -------
        OutcomesDisplay

        Raises
        ------
        ValueError
            If lengths differ, `healthy` is not among the labels, or no fault is known (all
            recordings are healthy, and `classes` are not given), so that false alarms and
            inspections cannot be distinguished.
        """
        truths, decided = label_list(y_true, "y_true"), label_list(y_pred, "y_pred")
        _tables.check_labels(decided, len(truths), "y_pred")
        states = {*truths, *label_list(() if classes is None else classes)}
        is_correct = np.array([one == other for one, other in zip(truths, decided, strict=True)])
        inspected = np.array([decision not in (*states, healthy) for decision in decided])
        is_healthy, called_healthy = (
            np.array([label == healthy for label in side]) for side in (truths, decided)
        )
        if not (is_healthy.any() or called_healthy.any()):
            raise ValueError(f"healthy = {healthy!r} is neither in y_true nor in y_pred.")
        if states == {healthy} and not called_healthy.all():
            raise ValueError(
                f"all recordings are {healthy!r}, so it is not known which decisions are faults. "
                f"Give classes, such as model.classes_."
            )
        outcome = np.select(
            [is_correct, inspected, is_healthy, called_healthy],
            ["correct", "inspection", "false alarm", "missed detection"],
            "wrong fault",
        )
        if conditions is None:
            conditions = np.full(len(truths), "all recordings")
        conditions = _tables.check_labels(conditions, len(truths), "conditions")
        rows = pd.DataFrame({name: outcome == name for name in OUTCOMES}).astype(int)
        counts = rows.groupby(conditions, sort=False).sum().rename_axis("condition")
        return cls(counts).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the outcomes in per cent, one row per bar, and the sum ``n`` of its counts."""
        sums = self.counts.sum(axis=1)
        return self.counts.mul(100).div(sums, axis=0).assign(n=sums)

    def _draw(self, ax: Any) -> Any:
        table = self.frame()
        panels = {"": table}
        if table.index.nlevels == 2:
            names = table.index.get_level_values(0).unique()
            panels = {str(name): table.loc[name] for name in names}
        longest = max(map(len, panels.values()))
        axes = _drawing.panel_axes(ax, len(panels), height=0.5 + 0.34 * longest)
        for panel, (title, part) in zip(axes, panels.items(), strict=True):
            self._draw_panel(panel, part)
            panel.set_title(title, fontsize=_drawing.SMALL + 2, loc="left")
        _drawing.label_x(axes, "share of the recordings [%]")
        _drawing.legend_above(axes[0])
        return axes

    def _draw_panel(self, panel: Any, part: pd.DataFrame) -> None:
        from matplotlib import rc_context

        heights, left = np.arange(len(part)), np.zeros(len(part))
        for name in (name for name in OUTCOMES if self.counts[name].any()):
            colour, hatch = OUTCOMES[name]
            style = {"color": colour, "edgecolor": "black", "hatch": hatch, "linewidth": 0.6}
            shares = part[name].to_numpy()
            with rc_context({"hatch.linewidth": 0.7}):
                panel.barh(heights, shares, 0.72, left=left, label=name, **style)
            left = left + shares
        names = [f"{_drawing.wrapped(name)}  (n = {n:g})" for name, n in part["n"].items()]
        panel.set_yticks(heights, names, fontsize=_drawing.SMALL)
        panel.set_ylim(len(part) - 0.4, -0.6)  # the first on top
        panel.set_xlim(0, 100)
