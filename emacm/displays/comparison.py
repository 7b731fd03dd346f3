"""Several evaluations side by side: rates, cost and log loss with their intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from emacm.displays import _drawing
from emacm.displays._display import Display
from emacm.displays._rates import INCHES, checked_rates, draw_rates, name_lines, rate_frame
from emacm.evaluation.comparison import Comparison

_LOSSES = {"expected_cost": "mean cost", "log_loss": "log loss [nats]"}


@dataclass(eq=False, repr=False)
class ComparisonDisplay(Display):
    """Rates of several evaluations, their mean cost and log loss, with confidence intervals.

    Parameters
    ----------
    table : DataFrame
        One row for each evaluation; columns ``false_alarm_rate``, ``false_alarm_rate_low``,
        ``false_alarm_rate_high`` and so on, from 0 to 1, and ``expected_cost`` and ``log_loss``
        with their limits, each of which may be absent. NaN where they are not known.
    scheme : str
        Hold-out scheme, for the title.
    figures : sequence of str, optional
        Rates to draw, as for `EvaluationDisplay`.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (1,), (2,) or (3,)
        Set when the display is drawn: rates, mean cost, log loss.
    figure_ : Figure
        Figure of these Axes.

    Raises
    ------
    TypeError, ValueError
        If a column is missing, or a rate is not from 0 to 1.

    Examples
    --------
    >>> import pandas as pd
    >>> table = pd.DataFrame(
    ...     {"accuracy": [0.9, 0.7], "accuracy_low": [0.8, 0.6], "accuracy_high": [0.95, 0.8]},
    ...     index=["current", "vibration"],
    ... )
    >>> ComparisonDisplay(table).frame()
      evaluation    figure  value  low  high
    0    current  accuracy    0.9  0.8  0.95
    1  vibration  accuracy    0.7  0.6  0.80
    """

    table: pd.DataFrame
    scheme: str = field(default="", kw_only=True)
    figures: Any = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        if not isinstance(self.table, pd.DataFrame) or self.table.empty:
            raise TypeError(f"table must be a DataFrame that is not empty, got {self.table!r}.")
        self.figures = checked_rates(self.table, self.figures)

    @classmethod
    def from_comparison(
        cls,
        comparison: Comparison,
        *,
        figures: str | Sequence[str] | None = None,
        ax: Any = None,
    ) -> ComparisonDisplay:
        """Draw the result of `compare`.

        Parameters
        ----------
        comparison : Comparison
            Result of `emacm.evaluation.comparison.compare`.
        figures : sequence of str, optional
            As for the class.
        ax : sequence of matplotlib Axes, optional
            One Axes for the rates, and one each for mean cost and log loss if they are known.

        Returns
        -------
        ComparisonDisplay

        Raises
        ------
        TypeError
            If `comparison` is not such a result.
        """
        if not isinstance(comparison, Comparison):
            raise TypeError(
                f"comparison must be the result of compare, got {type(comparison).__name__}."
            )
        return cls(comparison.table, scheme=comparison.scheme, figures=figures).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return one row for each evaluation and figure of merit, with its interval."""
        return rate_frame(self.table, [*self.figures, *self._losses], "evaluation")

    @property
    def _losses(self) -> list[str]:
        return [name for name in _LOSSES if name in self.table and self.table[name].notna().any()]

    def _draw(self, ax: Any) -> Any:
        losses = self._losses
        if ax is None:
            ax = self._panels()
        axes = _drawing.panel_axes(ax, 1 + len(losses))
        draw_rates(axes[0], self.table, self.figures)
        for panel, name in zip(axes[1:], losses, strict=True):
            self._draw_loss(panel, name, named=panel is axes[1])
        if self.scheme:
            axes[0].set_title(self.scheme, fontsize=_drawing.SMALL + 2, loc="left")
        return axes

    def _panels(self) -> list[Any]:
        """Return the Axes of a new figure: rates above, mean cost and log loss below."""
        n_lines, names = len(self.table), ["rates", *self._losses]
        below = 0.9 + 2 * INCHES * n_lines if self._losses else 0.0
        heights = [1.2 + INCHES * n_lines * (len(self.figures) + 1), below][: 1 + bool(below)]
        size = (_drawing.WIDTH, max(2.4, sum(heights)))
        figure = _drawing.pyplot().figure(figsize=size, layout="constrained")
        panels = [names[:1] * max(1, len(self._losses)), self._losses][: len(heights)]
        made = figure.subplot_mosaic(panels, height_ratios=heights)
        return [made[name] for name in names]

    def _draw_loss(self, panel: Any, name: str, *, named: bool) -> None:
        columns = (name, f"{name}_low", f"{name}_high")
        value, low, high = (self.table[column].to_numpy(float) for column in columns)
        heights = np.arange(len(self.table))
        panel.hlines(heights, low, high, linewidth=1.6, color="black", zorder=3)
        panel.plot(value, heights, "o", color="black", zorder=3)
        name_lines(panel, self.table)
        if not named:
            panel.set_yticklabels([])
        panel.set_xlim(left=min(0.0, np.nanmin([*value, *low])))
        panel.set_xlabel(_LOSSES[name])
