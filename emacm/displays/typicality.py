"""Typicality over the posterior probability: known recordings, and those of unknown states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from emacm._checks import check_number
from emacm.decisions.pipelines import before_the_last_step
from emacm.decisions.unknown import unknown_probability
from emacm.displays import _drawing, _tables
from emacm.displays._display import Display
from emacm.evaluation.novelty import FLAGGED
from emacm.evaluation.results import Evaluation

Array = NDArray[np.float64]

_COLUMNS = ("confidence", "typicality", "label", "is_unknown")
_SUREST = 6  # minus the decimal logarithm of 1 - confidence, at which points are drawn at most
_TICKS = (0, 0.5, 0.9, 0.99, 0.999, 0.9999, 0.99999, 0.999999)
_RAREST = 1e-12  # typicality at which points are drawn at least
_LINES = ("--", ":", "-.")


@dataclass(eq=False, repr=False)
class TypicalityDisplay(Display):
    """Typicality of recordings over the highest posterior probability.

    A posterior probability compares the known states with each other and may be close to 1 far
    from all of them; the typicality is low there. Recordings of unknown states are drawn in black,
    with a cross for each, one panel for each state that was left out of training.

    Parameters
    ----------
    table : DataFrame
        One row for each recording: "confidence" (highest posterior probability) and "typicality",
        from 0 to 1, "label" (true state) and "is_unknown" (whether this state was left out of
        training); optionally "left_out", the name of the panel.
    thresholds : mapping of str to float
        Typicalities to draw as horizontal lines, by name.
    healthy : str
        The healthy state: it is first in the legend and always has the same colour.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (n_panels,)
        Set when the display is drawn.
    figure_ : Figure
        Figure of these Axes.

    Raises
    ------
    TypeError, ValueError
        If a column is missing, or a value is not from 0 to 1.

    Notes
    -----
    The x axis is linear in the logarithm of one minus the confidence, which ends at 99.9999 %; the
    y axis is logarithmic and ends at 1e-12. Points beyond are drawn at the ends.

    Examples
    --------
    >>> import pandas as pd
    >>> table = pd.DataFrame(
    ...     {"confidence": [0.9, 1.0], "typicality": [0.5, 1e-4], "label": ["new", "worn"],
    ...      "is_unknown": [False, True]}
    ... )
    >>> TypicalityDisplay(table).frame()["typicality"].tolist()
    [0.5, 0.0001]
    """

    table: pd.DataFrame
    thresholds: Any = field(default_factory=lambda: {f"typicality {FLAGGED:g}": FLAGGED})
    healthy: Any = field(default=_drawing.HEALTHY, kw_only=True)

    def __post_init__(self) -> None:
        missing = [name for name in _COLUMNS if name not in getattr(self.table, "columns", ())]
        if missing or not len(self.table):
            raise ValueError(
                f"table must have the columns {list(_COLUMNS)} and at least one recording; it has "
                f"no {missing or 'recording'}."
            )
        for name in _COLUMNS[:2]:
            values = _tables.check_values(self.table[name], name, (None,), least=0)
            if (values > 1 + 1e-9).any():
                raise ValueError(f"{name} must be at most 1, got {values.max():g}.")
        if not isinstance(self.thresholds, Mapping):
            raise TypeError(f"thresholds must map names to numbers, got {self.thresholds!r}.")
        for name, value in self.thresholds.items():
            check_number(value, f"the threshold {name!r}", above=0, at_most=1)

    @classmethod
    def from_evaluation(
        cls, evaluation: Evaluation, *, left_out: str | None = None, ax: Any = None, **options: Any
    ) -> TypicalityDisplay:
        """Draw the recordings held out while families of faults were left out of training.

        Parameters
        ----------
        evaluation : Evaluation
            Result of `emacm.evaluation.evaluate.evaluate` for a classifier with an unknown state.
        left_out : str, optional
            Family to draw. Default: one panel for each.
        ax : matplotlib Axes or sequence of Axes, optional
            One Axes for each panel.
        **options
            As for the class: thresholds, healthy. Default of `thresholds`: a typicality of 0.01,
            and the one at which the unknown state is as probable as all known ones.

        Returns
        -------
        TypicalityDisplay

        Raises
        ------
        TypeError, ValueError
            If `evaluation` is not such a result, or no family (not this one) was left out.
        """
        table = left_out_predictions(evaluation, left_out)
        known = {
            "thresholds": _thresholds(table["typicality"], table["unknown_proba"]),
            "healthy": evaluation.scoring.healthy,
        }
        table = table.rename(columns={"true_label": "label"})
        return cls(table[["left_out", *_COLUMNS]], **(known | options)).plot(ax=ax)

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: Any, y: ArrayLike, *, ax: Any = None, **options: Any
    ) -> TypicalityDisplay:
        """Draw recordings that were not in training, of known and unknown states.

        Parameters
        ----------
        estimator : classifier or Pipeline
            Fitted; its last step has `predict_proba`, `typicality` and `unknown_proba`.
        X : list of Recording, or table
            Recordings.
        y : array-like of shape (n_recordings,)
            Their true states. Those that are not among ``estimator.classes_`` are unknown.
        ax : matplotlib Axes, optional
            Where to draw.
        **options
            As for `from_evaluation`.

        Returns
        -------
        TypicalityDisplay

        Raises
        ------
        TypeError, ValueError
            If the last step has no typicality, or the numbers of recordings differ.
        """
        final, features = before_the_last_step(estimator, X)
        if not (hasattr(final, "typicality") and hasattr(final, "unknown_proba")):
            raise TypeError(
                f"estimator must have typicality and unknown_proba, as CostSensitiveGaussianBayes "
                f"with unknown=; got {final!r}."
            )
        typicality = np.asarray(final.typicality(features))
        labels = _tables.check_labels(y, len(typicality), "y")
        table = pd.DataFrame(
            {
                "confidence": np.asarray(final.predict_proba(features)).max(axis=1),
                "typicality": typicality,
                "label": labels,
                "is_unknown": ~np.isin(labels, estimator.classes_),
            }
        )
        known = {"thresholds": _thresholds(typicality, final.unknown_proba(features))}
        return cls(table, **(known | options)).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the recordings: confidence, typicality, label, and whether it is unknown."""
        return self.table.copy()

    def _draw(self, ax: Any) -> Any:
        parts = {"": self.table}
        if "left_out" in self.table:
            parts = dict(list(self.table.groupby("left_out", sort=False)))
        axes = _drawing.panel_axes(ax, len(parts), height=2.6, shared="xy")
        rarest = max(_RAREST, min(self.table["typicality"].min(), *self.thresholds.values(), 1.0))
        for panel, (name, part) in zip(axes, parts.items(), strict=True):
            self._draw_panel(panel, part)
            panel.set_yscale("log")
            panel.set_ylim(rarest / 3, 2)
            panel.set_ylabel("typicality")
            panel.set_xlim(-0.1, _SUREST + 0.15)
            panel.set_xticks(_surprise(np.array(_TICKS)), [f"{100 * tick:g}" for tick in _TICKS])
            if name:
                text = f"{name} left out of training"
                panel.set_title(text, fontsize=_drawing.SMALL + 2, loc="left")
        _drawing.label_x(axes, "highest posterior [%]")
        handles = {
            label: handle
            for panel in axes
            for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
        }
        numbers = [*self._numbers, *(name for name in handles if name not in self._numbers)]
        shown = {name: handles[name] for name in numbers if name in handles}
        _drawing.legend_above(axes[0], handles=[*shown.values()], labels=[*shown])
        return axes

    @property
    def _numbers(self) -> dict[str, int]:
        names = sorted(set(self.table["label"].map(str)))
        return _drawing.state_numbers(names, self.healthy)

    def _draw_panel(self, panel: Any, part: pd.DataFrame) -> None:
        points = np.column_stack(
            [_surprise(part["confidence"]), np.maximum(part["typicality"], _RAREST)]
        )
        names, is_unknown = part["label"].map(str).to_numpy(), part["is_unknown"].to_numpy(bool)
        for name, number in self._numbers.items():
            chosen = (names == name) & ~is_unknown
            if chosen.any():
                marker = _drawing.style_of(_drawing.MARKERS, number)
                look = {"marker": marker, "edgecolor": "white", "linewidth": 0.4, "zorder": 2}
                colour = _drawing.colour_of(number)
                panel.scatter(*points[chosen].T, s=18, color=colour, label=name, **look)
        if is_unknown.any():
            look = {"marker": "x", "color": "black", "linewidth": 1.0, "zorder": 3}
            panel.scatter(*points[is_unknown].T, s=20, label="not in training", **look)
        for line, (name, value) in zip(_LINES * 9, self.thresholds.items(), strict=False):
            panel.axhline(value, color="0.35", linewidth=1, linestyle=line, label=name, zorder=1)


def left_out_predictions(evaluation: Any, left_out: str | None = None) -> pd.DataFrame:
    """Return the `novelty_predictions` of an evaluation, of all families left out or of one.

    Raises
    ------
    TypeError, ValueError
        If it is not the result of `evaluate`, or no family (not this one) was left out.
    """
    if not isinstance(evaluation, Evaluation):
        raise TypeError(
            f"evaluation must be the result of evaluate, got {type(evaluation).__name__}."
        )
    table = evaluation.novelty_predictions
    if table.empty:
        raise ValueError(
            "evaluation left no family of faults out of training. Evaluate a classifier with an "
            "unknown state (unknown=)."
        )
    families = list(table["left_out"].unique())
    if left_out is not None and left_out not in families:
        raise ValueError(f"left_out must be one of {families}, got {left_out!r}.")
    return table if left_out is None else table[table["left_out"] == left_out]


def _surprise(confidence: ArrayLike) -> Array:
    """Return minus the decimal logarithm of one minus the confidence, at most `_SUREST`."""
    return -np.log10(np.clip(1 - np.asarray(confidence, float), 10.0**-_SUREST, 1.0))


def _thresholds(typicality: ArrayLike, unknown_proba: ArrayLike) -> dict[str, float]:
    """Return a typicality of 0.01, and the one of an unknown state of probability one half."""
    found = {f"typicality {FLAGGED:g}": FLAGGED}
    level, probability = (np.asarray(values, float) for values in (typicality, unknown_proba))
    usable = np.flatnonzero((probability > 0) & (probability < 1) & (level > _RAREST))
    if not len(usable):
        return found
    first = usable[np.argmax(level[usable])]
    # With equal priors the odds are the evidence; the prior odds are what remains of the odds.
    evidence = _odds(unknown_probability(level[first], 0.5))
    prior = _odds(probability[first]) / evidence

    def excess(log_level: float) -> float:
        return float(np.log(prior * _odds(unknown_probability(np.exp(log_level), 0.5))))

    low = np.log(_RAREST)
    if excess(low) > 0 > excess(0.0):
        found["P(unknown) = 50 %"] = float(np.exp(brentq(excess, low, 0.0)))
    return found


def _odds(probability: Any) -> Any:
    return probability / (1 - probability)
