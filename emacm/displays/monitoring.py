"""Alarm charts, trends of health indices, and remaining life."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.utils.validation import check_is_fitted

from emacm.alarms.control_charts import CUSUM, EWMA
from emacm.displays import drawing
from emacm.displays.drawing import Display
from emacm.life.life_calibration import BEFORE_ONSET, DAMAGE
from emacm.life.remaining_life import RemainingLife

_LIMIT = {"color": "0.3", "linestyle": "--", "linewidth": 1.0}


@dataclass(eq=False, repr=False)
class AlarmDisplay(Display):
    """Statistic of an alarm over time, its limit, and the readings beyond it.

    Parameters
    ----------
    times : array-like of shape (n_readings,)
        Time, age or number of each reading.
    statistic : array-like of shape (n_readings,)
        Statistic of the chart.
    limit : float
        Limit of the statistic.
    two_sided : bool
        Whether the limit also holds downwards.
    name : str
        Name of the chart, for the label.
    time_label : str
        Label of the x axis, with its unit.

    Attributes
    ----------
    ax_, figure_
        Axes and figure, set when the display is drawn.

    Examples
    --------
    >>> AlarmDisplay([0, 1, 2], [0.5, 2.0, 5.5], 5.0).frame()["alarm"].tolist()
    [False, False, True]
    """

    times: ArrayLike
    statistic: ArrayLike
    limit: float
    two_sided: bool = field(default=False, kw_only=True)
    name: str = field(default="statistic", kw_only=True)
    time_label: str = field(default="number of the reading", kw_only=True)

    @classmethod
    def from_estimator(
        cls, estimator: EWMA | CUSUM, X: Any, times: ArrayLike, *, ax: Any = None, **options: Any
    ) -> AlarmDisplay:
        """Compute the chart of readings, from its start, and draw it.

        Parameters
        ----------
        estimator : EWMA or CUSUM
            Fitted; its state is neither used nor changed.
        X : array-like or DataFrame of shape (n_readings, n_columns)
            Readings; the chart of the first column is drawn.
        times : array-like of shape (n_readings,)
            Time, age or number of each reading.
        ax : matplotlib Axes, optional
            Where to draw.
        **options
            As for the class: time_label.

        Returns
        -------
        AlarmDisplay

        Raises
        ------
        TypeError, ValueError
            If `estimator` is no fitted alarm, or X is invalid.
        """
        check_is_fitted(estimator)
        statistic = deepcopy(estimator).reset().update(X).statistic[:, 0]
        options |= {"name": type(estimator).__name__, "two_sided": isinstance(estimator, EWMA)}
        return cls(times, statistic, estimator.limit_, **options).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return one row per reading: "time", "statistic", "alarm"."""
        statistic = np.asarray(self.statistic)
        beyond = np.abs(statistic) if self.two_sided else statistic
        alarm = beyond > self.limit
        return pd.DataFrame({"time": self.times, "statistic": statistic, "alarm": alarm})

    def _draw(self, ax: Any) -> Any:
        (ax,) = drawing.panel_axes(ax, height=2.6)
        table = self.frame()
        ax.plot(table["time"], table["statistic"], color=drawing.PLAIN, label="statistic")
        ax.axhline(self.limit, label=f"limit {self.limit:.3g}", **_LIMIT)
        if self.two_sided:
            ax.axhline(-self.limit, **_LIMIT)
        alarms = table[table["alarm"]]
        if len(alarms):
            look = {"color": drawing.COLOURS[1], "markersize": 4}
            first = f"alarm, first at {alarms['time'].iloc[0]:.6g}"
            ax.plot(alarms["time"], alarms["statistic"], "s", label=first, **look)
        ax.set(xlabel=self.time_label, ylabel=f"{self.name} [standard deviations]")
        drawing.legend_above(ax)
        return ax


@dataclass(eq=False, repr=False)
class TrendDisplay(Display):
    """Health index over time or cycles, one panel for each unit.

    The limit is a dashed line; its false alarm rate is stated. Recordings beyond it are filled.

    Parameters
    ----------
    table : DataFrame
        As of `health_trend`: columns "unit", "time", "index", "limit" (NaN if there is none),
        "alarm" and, optionally, "false_alarm", of at most 8 units. Rows without an index are not
        drawn.
    time_label : str
        Label of the time axis, with its unit.

    Attributes
    ----------
    ax_, figure_
        Axes (one for each unit) and figure, set when the display is drawn.

    Raises
    ------
    ValueError
        If no unit has an index, or there are too many units for one figure.

    Examples
    --------
    >>> table = pd.DataFrame({"unit": "A", "time": [1, 2], "index": [0.9, 3.1], "limit": 1.5})
    >>> display = TrendDisplay(table.assign(alarm=table["index"] > table["limit"]))
    >>> display.frame()["alarm"].tolist()
    [False, True]
    """

    table: Any
    time_label: str = field(default="time", kw_only=True)

    def __post_init__(self) -> None:
        self._units = self.frame()["unit"].unique().tolist()
        if not 1 <= len(self._units) <= 8:
            raise ValueError(
                f"a figure shows 1 to 8 units; the table has an index of {len(self._units)}. "
                f"Choose the rows of some units."
            )

    def frame(self) -> pd.DataFrame:
        """Return the rows that are drawn."""
        return self.table[self.table["index"].notna()].reset_index(drop=True)

    def _draw(self, ax: Any) -> Any:
        axes = drawing.panel_axes(ax, len(self._units))
        table = self.frame()
        rates = set(table.get("false_alarm", pd.Series(dtype=float)).dropna())
        stated = f" ({100 * max(rates):.3g} % false alarms)" if len(rates) == 1 else ""
        for panel, unit in zip(axes, self._units, strict=True):
            own = table[table["unit"] == unit]
            panel.plot(own["time"], own["index"], color="0.6", linewidth=0.9, zorder=1)
            for number, marker, label in ((0, "o", "within the limit"), (1, "s", "alarm")):
                chosen = own[own["alarm"] == number]
                text = label if (table["alarm"] == number).any() else None
                style = {"color": drawing.COLOURS[number], "markersize": 4}
                panel.plot(chosen["time"], chosen["index"], marker, label=text, **style)
            limits = own["limit"].dropna()
            if len(limits):
                panel.axhline(limits.iloc[-1], label=f"limit{stated}", **_LIMIT)
            panel.set_ylim(bottom=0)
            panel.set_ylabel("health index" if len(axes) == 1 else str(unit))
        if len(axes) > 1:
            axes[0].figure.supylabel("health index of unit", fontsize=10)
        drawing.label_x(axes, self.time_label)
        if pd.api.types.is_datetime64_any_dtype(table["time"]):
            drawing.date_axis(axes[-1], table["time"])
        drawing.legend_above(axes[0])
        return axes if len(axes) > 1 else axes[0]


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

    @classmethod
    def from_estimator(
        cls, estimator: RemainingLife, X: Any, y: Any = None, *, ax: Any = None, **options: Any
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
        table = estimator.predict_interval(X, np.zeros(len(X)))
        return cls(table, y, coverage=estimator.coverage, **options).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the table, with the column "true" if it is known."""
        return self.table if self.true is None else self.table.assign(true=self.true)

    def _draw(self, ax: Any) -> Any:
        (ax,) = drawing.panel_axes(ax, height=3.0)
        table = self.frame()
        top = 2.0 * table.filter(["median", "true"]).to_numpy().max()
        for stage, colour in ((BEFORE_ONSET, "#777777"), (DAMAGE, drawing.PLAIN)):
            rows = table[table["stage"] == stage]
            if len(rows):
                interval = f"{self.coverage:.0%} interval, {_NAMES[stage]}"
                upper = np.minimum(rows["upper"], top)
                look = {"color": drawing.tint(colour, 0.3), "linewidth": 0, "label": interval}
                ax.fill_between(rows["age"], rows["lower"], upper, **look)
                label = f"median, {_NAMES[stage]}"
                ax.plot(rows["age"], rows["median"], color=colour, label=label)
        if "true" in table:
            ax.plot(table["age"], table["true"], "k--", linewidth=1, label="true remaining life")
        ax.set_ylim(0, top)
        ax.set(xlabel=f"age [{self.unit}]", ylabel=f"remaining life [{self.unit}]")
        drawing.legend_above(ax)
        return ax
