"""Pictures of how often decisions were right, and in which way they were wrong."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from emacm.decisions.families import family_mapping
from emacm.decisions.labels import label_list
from emacm.decisions.metrics import are_correct, correct_families, label_of
from emacm.displays._drawing import (
    COLOURS,
    SMALL,
    legend_beside,
    name_panels_below,
    panel_axes,
    tint,
    wrapped,
)
from emacm.displays._tables import (
    check_labels,
    check_values,
)

# Outcome: colour and hatch; the darker in print, the worse.
OUTCOMES = {
    "correct": (tint(COLOURS[0], 0.25), ""),
    "false positive": (tint(COLOURS[4], 0.75), "////"),
    "wrong fault": (tint(COLOURS[3], 0.9), "...."),
    "false negative": (COLOURS[1], "xxxx"),
}
_ROW = 0.34  # inches for each bar


class OutcomesDisplay:
    """Correct and wrong decisions in per cent, by condition, one panel for each signal.

    Parameters
    ----------
    counts : DataFrame
        How many recordings had each outcome, or their shares: columns among "correct", "false
        positive" (healthy, and decided otherwise), "wrong fault" (neither healthy nor
        decided healthy, and another decision than the truth) and "false negative" (decided
        healthy, and not so). The index names conditions, or signals and conditions.
    show_n : bool
        Whether to write the sum of each row beside its bar: how many recordings it stands for.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (n_signals,)
        What was drawn on, once `plot` has run.
    figure_ : Figure
        The figure of `ax_`.

    Raises
    ------
    TypeError, ValueError
        If a column is no outcome, a row holds nothing or comes twice, or a count is negative or
        not finite.

    Notes
    -----
    The three outcomes are those of Chirico, section 4.4 (Figs. 4.65 to 4.72); a "wrong fault"
    needs more than two classes.

    Examples
    --------
    >>> import pandas as pd
    >>> counts = pd.DataFrame(
    ...     {"correct": [17, 20], "false negative": [3, 0]}, index=["condition 1", "condition 2"]
    ... )
    >>> OutcomesDisplay(counts).frame()[["correct", "false negative", "n"]]
                 correct  false negative     n
    condition 1     85.0            15.0  20.0
    condition 2    100.0             0.0  20.0
    """

    ax_: Any
    figure_: Any

    def __init__(self, counts: pd.DataFrame, *, show_n: bool = True) -> None:
        if not isinstance(counts, pd.DataFrame):
            raise TypeError(f"counts must be a DataFrame, got {type(counts).__name__}.")
        unknown = [column for column in counts.columns if column not in OUTCOMES]
        if unknown or counts.empty or counts.index.nlevels > 2:
            raise ValueError(
                f"counts must have columns among {list(OUTCOMES)} and rows named by a condition, "
                f"or by a signal and a condition; got columns {list(counts.columns)}, "
                f"{len(counts)} rows and {counts.index.nlevels} names for each."
            )
        if not counts.index.is_unique:
            double = counts.index[counts.index.duplicated()][0]
            raise ValueError(f"counts must name each row once, but {double!r} comes again.")
        check_values(counts, "counts", (None, None), least=0)
        self.counts = counts.reindex(columns=list(OUTCOMES), fill_value=0).astype(float)
        sums = self.counts.sum(axis=1)
        if (sums == 0).any():
            raise ValueError(f"counts of {sums.index[sums == 0][0]!r} are all 0. Leave it out.")
        self.show_n = show_n

    @classmethod
    def from_predictions(
        cls,
        y_true: ArrayLike,
        y_pred: ArrayLike,
        *,
        healthy: Any,
        families: Mapping[Any, Any] | None = None,
        conditions: ArrayLike | None = None,
        signals: ArrayLike | None = None,
        ax: Any = None,
    ) -> OutcomesDisplay:
        """Count the outcomes of decisions, and draw.

        Parameters
        ----------
        y_true : array-like of shape (n_recordings,)
            True classes.
        y_pred : array-like of shape (n_recordings,)
            Decisions. One that is no class, such as "inspect", is a false positive of a healthy
            unit and a wrong fault of another.
        healthy : str
            Which class is the healthy one (or which family, if there are families).
        families : mapping, optional
            {class: family} or {family: [classes]}. A decision for the right family is right, and so
            is one for another class of it. Without them labels are compared as they are, and a
            family decided for a sub-state is a wrong fault: state them wherever decisions are
            families.
        conditions : array-like of shape (n_recordings,), optional
            Operating condition of each. Default: all in one.
        signals : array-like of shape (n_recordings,), optional
            Signal that each decision was taken from. Default: a single panel.
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one for each signal.

        Returns
        -------
        OutcomesDisplay

        Raises
        ------
        ValueError
            If lengths differ, nobody and nothing is healthy, or a class has no family.
        """
        truths, decided = label_list(y_true, "y_true"), label_list(y_pred, "y_pred")
        check_labels(decided, len(truths), "y_pred")
        correct = {}
        if families is not None:
            correct = correct_families(family_mapping(families, list(dict.fromkeys(truths))))
        right = are_correct(truths, decided, correct)
        truths, decided = ([label_of(v, correct) for v in side] for side in (truths, decided))
        sound, passed = (np.array([v == healthy for v in a], bool) for a in (truths, decided))
        if not (sound.any() or passed.any()):
            raise ValueError(
                f"healthy = {healthy!r} is neither in y_true nor in y_pred, which hold "
                f"{sorted(set(map(str, truths)))} and {sorted(set(map(str, decided)))}."
            )
        outcome = np.select(
            [right, sound, passed], ["correct", "false positive", "false negative"], "wrong fault"
        )
        keys = {"signal": signals, "condition": conditions}
        index = [
            pd.Index(check_labels(values, len(truths), f"{name}s"), name=name)
            for name, values in keys.items()
            if values is not None
        ] or [pd.Index(np.full(len(truths), "all recordings"))]
        rows = pd.DataFrame({name: outcome == name for name in OUTCOMES}).astype(int)
        counts = rows.groupby(index, sort=False).sum()
        if signals is not None and conditions is None:
            counts.index = pd.MultiIndex.from_product([counts.index, ["all recordings"]])
        return cls(counts).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the numbers: a row a bar, its outcomes in per cent and the sum ``n`` of counts."""
        sums = self.counts.sum(axis=1)
        return self.counts.mul(100).div(sums, axis=0).assign(n=sums)

    def plot(self, *, ax: Any = None) -> OutcomesDisplay:
        """Draw a bar for each condition, cut by outcome.

        Parameters
        ----------
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one for each signal. Default: a new figure.

        Returns
        -------
        OutcomesDisplay
            Itself.
        """
        table = self.frame()
        if table.index.nlevels == 1:
            panels = {"": table}
        else:
            signals = table.index.get_level_values(0)
            panels = {str(name): table.loc[name] for name in signals.unique()}
        longest = max(map(len, panels.values()))
        axes = panel_axes(ax, len(panels), height=0.5 + _ROW * longest, shared="x")
        for panel, (title, part) in zip(axes, panels.items(), strict=True):
            self._draw_panel(panel, part)
            panel.set_title(title, fontsize=SMALL + 2, loc="left")
        name_panels_below(axes, "share of the recordings [%]")
        legend_beside(axes[0])
        self.ax_, self.figure_ = axes, axes[0].figure
        return self

    def _draw_panel(self, panel: Any, part: pd.DataFrame) -> None:
        from matplotlib import rc_context

        heights, left = np.arange(len(part)), np.zeros(len(part))
        drawn = [name for name in OUTCOMES if self.counts[name].any()]
        for name in drawn:
            colour, hatch = OUTCOMES[name]
            style = {"color": colour, "edgecolor": "black", "hatch": hatch, "linewidth": 0.6}
            shares = part[name].to_numpy()
            with rc_context({"hatch.linewidth": 0.7}):
                panel.barh(heights, shares, 0.72, left=left, label=name, **style)
            left = left + shares
        names = [wrapped(name) for name in part.index]
        if self.show_n:
            names = [f"{name}  (n = {n:g})" for name, n in zip(names, part["n"], strict=True)]
        panel.set_yticks(heights, names, fontsize=SMALL)
        panel.set_ylim(len(part) - 0.4, -0.6)  # the first on top
        panel.set_xlim(0, 100)
