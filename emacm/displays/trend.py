"""Trend of a health index: one panel for each unit, with limit and alarms."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from emacm.displays import _drawing
from emacm.displays._display import Display
from emacm.monitoring.health_index import HealthIndex

_COLUMNS = ("unit", "time", "index", "limit", "alarm")
_MOST = 8  # panels


@dataclass(eq=False, repr=False)
class TrendDisplay(Display):
    """Health index over time or cycles, one panel for each unit.

    The limit is a dashed line; its false alarm rate is stated. Recordings beyond it are filled.

    Parameters
    ----------
    table : DataFrame
        As of `HealthIndex.trend`: columns "unit", "time", "index", "limit" (NaN if there is none)
        and "alarm". Rows without an index are not drawn.
    time_label : str
        Label of the time axis, with its unit.
    units : sequence of label, optional
        Units to be drawn, in this order. Default: all; at most 8.

    Attributes
    ----------
    ax_, figure_
        Axes (one for each unit) and figure, set when the display is drawn.

    Raises
    ------
    ValueError
        If a column is missing, no unit has an index, or there are too many units for one figure.

    Examples
    --------
    >>> table = pd.DataFrame({"unit": "A", "time": [1, 2], "index": [0.9, 3.1], "limit": 1.5})
    >>> display = TrendDisplay(table.assign(alarm=table["index"] > table["limit"]))
    >>> display.frame()["alarm"].tolist()
    [False, True]
    """

    table: Any
    time_label: str = field(default="time", kw_only=True)
    units: Any = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        missing = [name for name in _COLUMNS if name not in getattr(self.table, "columns", ())]
        if missing:
            raise ValueError(
                f"table must have the columns {list(_COLUMNS)}, as of HealthIndex.trend; it has no "
                f"{missing}."
            )
        known = self.table["unit"][self.table["index"].notna()].unique().tolist()
        chosen = known if self.units is None else list(self.units)
        unknown = [unit for unit in chosen if unit not in known]
        if unknown or not chosen:
            raise ValueError(f"no index of unit {(unknown or ['any'])[0]!r}; known are {known}.")
        if len(chosen) > _MOST:
            raise ValueError(
                f"{len(chosen)} units do not fit into one figure. Choose at most {_MOST} by units=."
            )
        self._units = chosen

    @classmethod
    def from_estimator(
        cls,
        estimator: HealthIndex,
        X: Any,
        times: ArrayLike,
        units: ArrayLike | None = None,
        *,
        time_label: str = "time",
        ax: Any = None,
    ) -> TrendDisplay:
        """Compute the trend of recordings, and draw it.

        Parameters
        ----------
        estimator : HealthIndex
            Fitted.
        X, times, units
            As for `HealthIndex.trend`.
        time_label : str
            As for the class.
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one Axes for each unit.

        Returns
        -------
        TrendDisplay

        Raises
        ------
        ValueError
            As `HealthIndex.trend`.
        """
        return cls(estimator.trend(X, times, units), time_label=time_label).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the rows that are drawn."""
        drawn = self.table["unit"].isin(self._units) & self.table["index"].notna()
        return self.table[drawn].reset_index(drop=True)

    def _draw(self, ax: Any) -> Any:
        axes = _drawing.panel_axes(ax, len(self._units))
        table = self.frame()
        rate = self.table.attrs.get("false_alarm")
        stated = "" if rate is None else f" ({100 * rate:g} % false alarms)"
        for panel, unit in zip(axes, self._units, strict=True):
            own = table[table["unit"] == unit]
            alarm = own["alarm"].to_numpy(bool)
            panel.plot(own["time"], own["index"], color="0.6", linewidth=0.9, zorder=1)
            for chosen, colour, marker, label in (
                (~alarm, _drawing.COLOURS[0], "o", "within the limit"),
                (alarm, _drawing.COLOURS[1], "s", "alarm"),
            ):
                style = {"color": colour, "marker": marker, "linestyle": "", "markersize": 4}
                anywhere = bool((table["alarm"].to_numpy(bool) == (label == "alarm")).any())
                text = label if panel is axes[0] and anywhere else None
                panel.plot(own["time"][chosen], own["index"][chosen], label=text, **style)
            limits = own["limit"].to_numpy(float)
            if np.isfinite(limits).any():
                look = {"color": "black", "linestyle": "--", "linewidth": 1.0}
                text = f"limit{stated}" if panel is axes[0] else None
                panel.axhline(limits[np.isfinite(limits)][-1], label=text, **look)
            panel.set_ylim(bottom=0)
            panel.set_ylabel("health index" if len(axes) == 1 else f"{unit}")
        if len(axes) > 1:
            axes[0].figure.supylabel("health index of unit", fontsize=10)
        _drawing.label_x(axes, self.time_label)
        if isinstance(table["time"].iloc[0], pd.Timestamp):
            axes[0].figure.autofmt_xdate()
        _drawing.legend_above(axes[0])
        return axes if len(axes) > 1 else axes[0]
