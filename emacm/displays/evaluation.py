"""Results of an evaluation: rates by hold-out scheme, confusion matrix, reliability, outcomes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.utils import check_consistent_length

from emacm.decisions.costs import label_list
from emacm.displays import drawing
from emacm.displays.drawing import Display
from emacm.evaluation.evaluate import Evaluation

# Rate: label, colour and marker.
RATES = {
    "balanced_accuracy": ("balanced accuracy", drawing.PLAIN, "o"),
    "false_alarm_rate": ("false alarms (of healthy)", drawing.COLOURS[4], "s"),
    "inspection_rate": ("inspections (of healthy)", "0.4", "v"),
    "missed_detection_rate": ("missed detections (of faulty)", drawing.COLOURS[1], "^"),
}
_ENDS = ("", "_low", "_high")  # of a rate and its interval
CENTRED = {"ha": "center", "va": "center", "fontsize": drawing.SMALL}


@dataclass(eq=False, repr=False)
class EvaluationDisplay(Display):
    """Rates by hold-out scheme with their intervals, confusion matrix, and reliability.

    Parameters
    ----------
    table : DataFrame
        One row for each hold-out scheme. Rates from 0 to 1 are drawn, of "balanced_accuracy",
        "false_alarm_rate", "inspection_rate" and "missed_detection_rate" those it has, each with
        its interval, such as "balanced_accuracy_low" and "balanced_accuracy_high"; NaN where they
        are not known.
    confusion : DataFrame
        Counts: rows are the decisions (families, if there are any), columns the true classes.
    calibration : DataFrame, optional
        One row for each bin of confidence (the highest posterior probability): "confidence" and
        "frequency" (the fraction of correct decisions) with its interval "low" to "high" (may be
        NaN), and "count". Without it there is no third panel.
    scheme : str
        Scheme of `confusion` and `calibration`.
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
    KeyError
        If a column is missing.

    Examples
    --------
    >>> import pandas as pd
    >>> table = pd.DataFrame(
    ...     {"inspection_rate": [0.2], "inspection_rate_low": 0.1, "inspection_rate_high": 0.3},
    ...     index=["by run"],
    ... )
    >>> confusion = pd.DataFrame([[9, 1], [1, 9]], index=["new", "worn"], columns=["new", "worn"])
    >>> EvaluationDisplay(table, confusion).frame().loc["by run"].tolist()
    [0.2, 0.1, 0.3]
    """

    table: pd.DataFrame
    confusion: pd.DataFrame
    calibration: pd.DataFrame | None = None
    scheme: str = field(default="", kw_only=True)
    healthy: Any = field(default=drawing.HEALTHY, kw_only=True)

    def __post_init__(self) -> None:
        self.figures = [name for name in RATES if name in self.table]
        rows, classes = (
            sorted(names, key=lambda name: str(name) != str(self.healthy))
            for names in self.confusion.axes
        )
        self.confusion = self.confusion.loc[rows, classes]

    @classmethod
    def from_evaluation(
        cls, evaluation: Evaluation, *, scheme: str | None = None, ax: Any = None, **options: Any
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
            As for the class: healthy. Default: that of the evaluation.

        Returns
        -------
        EvaluationDisplay

        Raises
        ------
        ValueError
            If `scheme` was not scored.
        """
        scored = list(evaluation.confusions)
        chosen = next(iter(scored[1:] + scored), None) if scheme is None else scheme
        if chosen not in scored:
            raise ValueError(f"scheme must be one that was scored: {scored}; got {scheme!r}.")
        curve = evaluation.calibration
        curve = curve[curve["scheme"] == chosen] if len(curve) else None
        if evaluation.scoring.healthy is not None:
            options.setdefault("healthy", evaluation.scoring.healthy)
        confusion = evaluation.confusions[chosen]
        return cls(evaluation.table, confusion, curve, scheme=chosen, **options).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the rates with their intervals, one row per scheme."""
        return self.table[[f"{rate}{end}" for rate in self.figures for end in _ENDS]]

    def _draw(self, ax: Any) -> Any:
        n_panels = 2 if self.calibration is None else 3
        axes = self._panels() if ax is None else drawing.panel_axes(ax, n_panels)
        self._draw_rates(axes[0])
        self._draw_confusion(axes[1])
        if self.calibration is not None:
            self._draw_reliability(axes[2], self.calibration)
        return axes

    def _panels(self) -> Any:
        """Return the Axes of a new figure: rates above, confusion and reliability below."""
        n_rows, n_columns = self.confusion.shape
        rates = 1.0 + 0.19 * len(self.table) * (len(self.figures) + 1)  # inches
        heights = [rates, max(2.4, 1.3 + 0.26 * n_rows)]
        panels = [["rates"], ["confusion"]]
        if self.calibration is not None and n_columns <= 6:  # there is room for both
            panels = [["rates"] * 2, ["confusion", "reliability"]]
        elif self.calibration is not None:
            panels, heights = [*panels, ["reliability"]], [*heights, 3.0]
        size = (drawing.WIDTH, sum(heights))
        figure = drawing.pyplot().figure(figsize=size, layout="constrained")
        return np.array([*figure.subplot_mosaic(panels, height_ratios=heights).values()])

    def _draw_rates(self, panel: Any) -> None:
        """Draw the rates in per cent with their intervals, the first scheme on top."""
        places = np.arange(len(self.table))
        for number, name in enumerate(self.figures):
            value, low, high = (100 * self.table[name + end].to_numpy(float) for end in _ENDS)
            if np.isnan(value).all():
                continue
            label, colour, marker = RATES[name]
            heights = places + (number - (len(self.figures) - 1) / 2) * 0.6 / len(self.figures)
            panel.hlines(heights, low, high, linewidth=1.6, color=colour, zorder=3)
            panel.plot(value, heights, marker, label=label, color=colour, zorder=3)
        for height in places[self.table[self.figures].isna().all(axis=1)]:
            panel.text(50, height, "cannot be scored", **CENTRED)
        panel.set_yticks(places, [_scheme_label(name, row) for name, row in self.table.iterrows()])
        panel.tick_params(axis="y", labelsize=drawing.SMALL, length=0)
        panel.set_ylim(len(places) - 0.5, -0.5)  # the first on top
        panel.grid(axis="x", color="0.9", linewidth=0.6)
        for height in places[1:] - 0.5:
            panel.axhline(height, color="0.8", linewidth=0.6)
        panel.set_xlim(-2, 102)
        panel.set_xlabel("share of the recordings [%]")
        drawing.legend_above(panel, title="line: confidence interval")

    def _draw_confusion(self, panel: Any) -> None:
        from matplotlib.colors import LinearSegmentedColormap

        counts = self.confusion.to_numpy(float)
        below = counts.sum(axis=0)
        shares = counts / np.where(below > 0, below, 1)
        ramp = LinearSegmentedColormap.from_list("shares", ["white", drawing.PLAIN])
        panel.imshow(shares, cmap=ramp, vmin=0, vmax=1, aspect="auto")
        for (row, column), count in np.ndenumerate(counts):
            if count:
                ink = "white" if shares[row, column] > 0.55 else "black"
                panel.text(column, row, f"{count:g}", color=ink, **CENTRED)
        upright = max(len(str(name)) for name in self.confusion.columns) > 5
        turned = {"rotation": 40, "ha": "right", "rotation_mode": "anchor"} if upright else {}
        style = {"fontsize": drawing.SMALL}
        panel.set_xticks(range(counts.shape[1]), self.confusion.columns, **style, **turned)
        rows = [drawing.wrapped(name) for name in self.confusion.index]
        panel.set_yticks(range(len(counts)), rows, **style)
        panel.tick_params(length=0)
        drawing.label_axes(panel, "true class", "decision")
        self._title(panel, "recordings, shaded by\nthe share of each true class")

    def _draw_reliability(self, panel: Any, curve: pd.DataFrame) -> None:
        panel.plot([0, 100], [0, 100], color="0.5", linestyle="--", linewidth=1)
        names = ["confidence", "frequency", "low", "high"]
        confidence, frequency, low, high = 100 * curve[names].to_numpy(float).T
        panel.vlines(confidence, low, high, color=drawing.PLAIN, linewidth=1.4)
        panel.plot(confidence, frequency, "-", color=drawing.PLAIN, linewidth=0.8)
        sizes = 12 + 90 * curve["count"].to_numpy(float) / curve["count"].sum()
        panel.scatter(confidence, frequency, sizes, color=drawing.PLAIN, zorder=3)
        panel.set(xlim=(-2, 102), ylim=(-2, 102))
        panel.set_xlabel("confidence [%]")
        drawing.label_y(panel, "observed frequency", "%")
        self._title(panel, "reliability\n(area: number of recordings)")

    def _title(self, panel: Any, text: str) -> None:
        scheme = f"{self.scheme}: " if self.scheme else ""
        panel.set_title(f"{scheme}{text}", fontsize=drawing.SMALL)


def _scheme_label(name: Any, row: pd.Series) -> str:
    """Return the name of a scheme, with the groups on which its intervals are based."""
    if not row.get("groups") or "resampled" not in row:
        return drawing.wrapped(name)
    return f"{drawing.wrapped(name)}\n({row['resampled']}s: {row['groups']})"


# Colour and hatch of each outcome; the darker in print, the more serious.
OUTCOMES = {
    "correct": (drawing.tint(drawing.COLOURS[2], 0.25), ""),
    "inspection": ("#ffffff", "...."),
    "false alarm": (drawing.tint(drawing.COLOURS[4], 0.75), "////"),
    "wrong fault": (drawing.tint(drawing.COLOURS[3], 0.9), "----"),
    "missed detection": (drawing.COLOURS[1], "xxxx"),
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
        truths = pd.Series(label_list(y_true, "y_true"), dtype=object)
        decided = pd.Series(label_list(y_pred, "y_pred"), dtype=object)
        if conditions is None:
            conditions = np.full(len(truths), "all recordings")
        check_consistent_length(truths, decided, conditions)
        states = {*truths, *label_list(() if classes is None else classes)}
        inspected = ~decided.isin([*states, healthy])
        is_healthy, called_healthy = truths == healthy, decided == healthy
        if not (is_healthy.any() or called_healthy.any()):
            raise ValueError(f"healthy = {healthy!r} is neither in y_true nor in y_pred.")
        if states == {healthy} and not called_healthy.all():
            raise ValueError(
                f"all recordings are {healthy!r}, so it is not known which decisions are faults. "
                f"Give classes, such as model.classes_."
            )
        outcome = np.select(
            [truths == decided, inspected, is_healthy, called_healthy],
            ["correct", "inspection", "false alarm", "missed detection"],
            "wrong fault",
        )
        rows = pd.DataFrame({name: outcome == name for name in OUTCOMES}).astype(int)
        counts = rows.groupby(np.asarray(conditions), sort=False).sum().rename_axis("condition")
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
        axes = drawing.panel_axes(ax, len(panels), height=0.5 + 0.34 * longest)
        for panel, (title, part) in zip(axes, panels.items(), strict=True):
            self._draw_panel(panel, part)
            panel.set_title(title, fontsize=drawing.SMALL + 2, loc="left")
        drawing.label_x(axes, "share of the recordings [%]")
        drawing.legend_above(axes[0])
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
        names = [f"{drawing.wrapped(name)}  (n = {n:g})" for name, n in part["n"].items()]
        panel.set_yticks(heights, names, fontsize=drawing.SMALL)
        panel.set_ylim(len(part) - 0.4, -0.6)  # the first on top
        panel.set_xlim(0, 100)
