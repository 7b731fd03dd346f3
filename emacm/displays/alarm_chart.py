"""Alarm chart: the statistic of an alarm over time, its limit, and the alarms."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_number
from emacm.displays import _drawing, _tables
from emacm.displays._display import Display
from emacm.monitoring.alarms import CUSUM, EWMA


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
        Name of the statistic, for the label.
    time_label : str
        Label of the x axis, with its unit.

    Attributes
    ----------
    ax_, figure_
        Axes and figure, set when the display is drawn.

    Raises
    ------
    TypeError, ValueError
        If the lengths differ, a value is not finite, or the limit is not positive.

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

    def __post_init__(self) -> None:
        self.times = _tables.check_values(self.times, "times", (None,))
        self.statistic = _tables.check_values(self.statistic, "statistic", (len(self.times),))
        check_number(self.limit, "limit", above=0)

    @classmethod
    def from_estimator(
        cls,
        estimator: EWMA | CUSUM,
        X: Any,
        times: ArrayLike | None = None,
        *,
        column: int = 0,
        ax: Any = None,
        **options: Any,
    ) -> AlarmDisplay:
        """Compute the chart of readings, from its start, and draw it.

        Parameters
        ----------
        estimator : EWMA or CUSUM
            Fitted; its state is neither used nor changed.
        X : array-like or DataFrame of shape (n_readings, n_columns)
            Readings.
        times : array-like of shape (n_readings,), optional
            Default: the number of each reading, from 1.
        column : int
            Column to draw.
        ax : matplotlib Axes, optional
            Where to draw.
        **options
            As for the class: name, time_label.

        Returns
        -------
        AlarmDisplay

        Raises
        ------
        TypeError, ValueError
            If `estimator` is no fitted alarm, or X is invalid.
        """
        if not isinstance(estimator, EWMA | CUSUM):
            raise TypeError(f"estimator must be EWMA or CUSUM, got {type(estimator).__name__}.")
        check_is_fitted(estimator)
        state = estimator.state()
        statistic = estimator.reset().update(X).statistic[:, column]
        estimator.restore(state)
        known: dict[str, Any] = {
            "two_sided": isinstance(estimator, EWMA),
            "name": type(estimator).__name__ + " [standard deviations]",
        }
        times = np.arange(1, len(statistic) + 1) if times is None else times
        return cls(times, statistic, estimator.limit_, **(known | options)).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return one row per reading: "time", "statistic", "alarm"."""
        statistic = np.asarray(self.statistic)
        beyond = np.abs(statistic) if self.two_sided else statistic
        columns = {"time": self.times, "statistic": statistic, "alarm": beyond > self.limit}
        return pd.DataFrame(columns)

    def _draw(self, ax: Any) -> Any:
        (ax,) = _drawing.panel_axes(ax, height=2.6)
        table = self.frame()
        ax.plot(table["time"], table["statistic"], color=_drawing.PLAIN, label="statistic")
        style = {"color": "0.3", "linestyle": "--", "linewidth": 1}
        ax.axhline(self.limit, label=f"limit {self.limit:.3g}", **style)
        if self.two_sided:
            ax.axhline(-self.limit, **style)
        alarms = table[table["alarm"]]
        if len(alarms):
            look = {"color": _drawing.COLOURS[1], "marker": "s", "markersize": 4, "linestyle": ""}
            first = f"alarm, first at {alarms['time'].iloc[0]:.6g}"
            ax.plot(alarms["time"], alarms["statistic"], label=first, **look)
        _drawing.label_axes(ax, self.time_label, self.name)
        _drawing.legend_above(ax)
        return ax
