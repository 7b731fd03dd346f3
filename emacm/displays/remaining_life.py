"""Remaining life of a unit over its age, with prediction interval and true life."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from emacm.displays import _drawing, _tables
from emacm.displays._display import Display
from emacm.monitoring.life_calibration import BEFORE_ONSET, DAMAGE
from emacm.monitoring.remaining_life import RemainingLife

_COLUMNS = ("age", "stage", "median", "lower", "upper")
_NAMES = {BEFORE_ONSET: "life of the population", DAMAGE: "from the health index"}


@dataclass(eq=False, repr=False)
class RemainingLifeDisplay(Display):
    """Remaining life of one unit over its age.

    Before the onset of damage, where only the life of the population is known, interval and median
    are grey.

    Parameters
    ----------
    table : DataFrame
        Result of `RemainingLife.predict_interval` for one unit: "age", "stage", "median", "lower",
        "upper"; infinite upper limits are drawn to the upper end.
    true : array-like of shape (n_readings,), optional
        True remaining life at each age.
    unit : str
        Unit of time, for the labels.
    coverage : float
        Coverage of the interval, for the legend.

    Attributes
    ----------
    ax_, figure_
        Axes and figure, set when the display is drawn.

    Raises
    ------
    TypeError, ValueError
        If a column is missing, ages do not increase, or `true` has another length.

    Examples
    --------
    >>> table = pd.DataFrame(
    ...     {"age": [0.0, 9.0], "stage": ["before onset", "damage"], "median": [50.0, 11.0],
    ...      "lower": [5.0, 7.0], "upper": [np.inf, 19.0]}
    ... )
    >>> RemainingLifeDisplay(table, true=[20.0, 11.0]).frame()["true"].tolist()
    [20.0, 11.0]
    """

    table: pd.DataFrame
    true: ArrayLike | None = None
    unit: str = field(default="h", kw_only=True)
    coverage: float = field(default=0.9, kw_only=True)

    def __post_init__(self) -> None:
        missing = [name for name in _COLUMNS if name not in getattr(self.table, "columns", ())]
        if missing or not len(self.table):
            raise ValueError(
                f"table must have the columns {list(_COLUMNS)} and at least one reading; it has no "
                f"{missing or 'reading'}. Pass the result of RemainingLife.predict_interval."
            )
        if (np.diff(self.table["age"]) <= 0).any():
            raise ValueError("the ages in table must increase: pass the rows of one unit, sorted.")
        if self.true is not None:
            self.true = _tables.check_values(self.true, "true", (len(self.table),), least=0)

    @classmethod
    def from_estimator(
        cls,
        estimator: RemainingLife,
        X: Any,
        y: ArrayLike | None = None,
        *,
        ax: Any = None,
        **options: Any,
    ) -> RemainingLifeDisplay:
        """Predict the remaining life of one unit as it ages, and draw it.

        Parameters
        ----------
        estimator : RemainingLife
            Fitted on other units.
        X : array-like or DataFrame of shape (n_readings, n_columns)
            Readings of one unit, by increasing age.
        y : array-like of shape (n_readings,), optional
            True remaining lives.
        ax : matplotlib Axes, optional
            Where to draw.
        **options
            As for the class: unit.

        Returns
        -------
        RemainingLifeDisplay

        Raises
        ------
        TypeError, ValueError
            If `estimator` is no fitted `RemainingLife`, or X is invalid.
        """
        if not isinstance(estimator, RemainingLife):
            raise TypeError(f"estimator must be RemainingLife, got {type(estimator).__name__}.")
        table = estimator.predict_interval(X, np.zeros(len(X)))
        known: dict[str, Any] = {"coverage": estimator.coverage}
        return cls(table, y, **(known | options)).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the table, with the column "true" if it is known."""
        return self.table if self.true is None else self.table.assign(true=self.true)

    def _draw(self, ax: Any) -> Any:
        (ax,) = _drawing.panel_axes(ax, height=3.0)
        table = self.frame()
        shown = [table["median"].max()] + ([table["true"].max()] if "true" in table else [])
        top = 2.0 * max(float(np.max(shown)), 1e-300)
        damaged = (table["stage"] == DAMAGE).to_numpy()
        first = int(np.argmax(damaged)) if damaged.any() else len(table)
        for stage, rows, colour in (
            (BEFORE_ONSET, table.iloc[: first + 1] if first else table.iloc[:0], "#777777"),
            (DAMAGE, table.iloc[first:], _drawing.PLAIN),
        ):
            if len(rows):
                interval = f"{self.coverage:.0%} interval, {_NAMES[stage]}"
                upper = np.minimum(rows["upper"], top)
                look = {"color": _drawing.tint(colour, 0.3), "linewidth": 0, "label": interval}
                # Before the onset, the interval is that of the last reading until the next one.
                step = "post" if stage == BEFORE_ONSET else None
                ax.fill_between(rows["age"], rows["lower"], upper, step=step, **look)
                median = rows if stage == DAMAGE or first == len(table) else rows.iloc[:-1]
                ax.plot(
                    median["age"], median["median"], color=colour, label=f"median, {_NAMES[stage]}"
                )
        if "true" in table:
            style = {"color": "black", "linestyle": "--", "linewidth": 1}
            ax.plot(table["age"], table["true"], label="true remaining life", **style)
        ax.set_ylim(0, top)
        _drawing.label_axes(ax, f"age [{self.unit}]", f"remaining life [{self.unit}]")
        _drawing.legend_above(ax)
        return ax
