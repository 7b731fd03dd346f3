"""Map of the training domain: the operating conditions that training recordings cover."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from emacm.displays import drawing
from emacm.displays.drawing import Display
from emacm.models.evidence import operating_points


@dataclass(eq=False, repr=False)
class DomainDisplay(Display):
    """Speeds and conditions of training recordings, one bar for each recording.

    Parameters
    ----------
    points : DataFrame
        One row for each recording: "state", "slowest" and "fastest" speed [rad/s], and conditions
        such as "load" or "severity".
    condition : str, optional
        Column of the y axis. Default: the first condition that is not the same everywhere; if
        there is none, recordings are drawn by state.
    healthy : object
        The healthy state.

    Attributes
    ----------
    ax_, figure_
        Axes and figure, set when the display is drawn.

    See Also
    --------
    emacm.outside_training : Recordings outside of the domain.

    Examples
    --------
    >>> points = pd.DataFrame({"state": ["new"], "slowest": [52.36], "fastest": [104.72]})
    >>> DomainDisplay(points).frame().round().to_dict("records")
    [{'state': 'new', 'slowest': 500.0, 'fastest': 1000.0}]
    """

    points: pd.DataFrame
    condition: str | None = field(default=None, kw_only=True)
    healthy: Any = field(default=drawing.HEALTHY, kw_only=True)

    def __post_init__(self) -> None:
        conditions = self.points.drop(columns=["state", "slowest", "fastest"])
        varying = [name for name in conditions if conditions[name].nunique() > 1]
        self.condition = self.condition or next(iter(varying), None)

    @classmethod
    def from_recordings(
        cls, X: Any, y: Sequence[Any], *, ax: Any = None, **options: Any
    ) -> DomainDisplay:
        """Compute the speeds of recordings, and draw them.

        Parameters
        ----------
        X : sequence of Recording
            Conditions are the numbers under "load", "speed", "torque", "temperature", "pressure"
            and "severity" in `meta`.
        y : sequence of shape (n_recordings,)
            State of each.
        ax : matplotlib Axes, optional
            Where to draw.
        **options
            As for the class: condition, healthy.

        Returns
        -------
        DomainDisplay
        """
        return cls(operating_points(X, y), **options).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return one row per recording: "state", "slowest", "fastest" [rpm], and conditions."""
        per_minute = self.points[["slowest", "fastest"]] * 30 / np.pi
        return self.points.assign(**per_minute)

    def _draw(self, ax: Any) -> Any:
        (ax,) = drawing.panel_axes(ax, height=2.6 if self.condition else 1.7)
        table = self.frame()
        numbers = drawing.state_numbers(sorted(table["state"].astype(str)), self.healthy)
        values = table[self.condition].to_numpy(float) if self.condition else np.zeros(len(table))
        known, groups = np.unique(values, return_inverse=True)
        width = 0.5 * (np.diff(known).min() if len(known) > 1 else 1.0) / max(1, len(numbers))
        # Bars of several states under the same condition stand side by side about its value.
        places = table["state"].astype(str).map(list(numbers).index)
        places = places.groupby(groups).rank("dense")
        places -= (places.groupby(groups).transform("max") + 1) / 2
        for name, number in numbers.items():
            own = (table["state"].astype(str) == name).to_numpy()
            heights = values[own] + width * places.to_numpy()[own]
            ends = table.loc[own, ["slowest", "fastest"]].to_numpy().T
            look = {"color": drawing.colour_of(number), "alpha": 0.6, "markersize": 4}
            look["marker"] = drawing.style_of(drawing.MARKERS, number)
            look["linewidth"] = 12 / (3 + len(numbers))
            ax.plot(ends, np.stack([heights] * 2), **look)[0].set_label(name)
        drawing.label_axes(ax, "speed of the shaft [rpm]", self.condition or "state")
        if not self.condition:
            ax.set_yticks(width * (np.arange(len(numbers)) - (len(numbers) - 1) / 2), numbers)
        elif len(known) <= 8:
            ax.set_yticks(known)
        drawing.legend_above(ax)
        return ax
