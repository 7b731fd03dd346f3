"""Base classes of the displays: `plot`, and power by group of recordings and channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_choice
from emacm.displays import _drawing, _tables

SCALES = ("dB", "linear")


class Display:
    """Computed values, their table and their figure."""

    ax_: Any
    figure_: Any

    def plot(self, *, ax: Any = None) -> Self:
        """Draw the values.

        Parameters
        ----------
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one Axes for each panel. Default: a new figure, 16 cm wide.

        Returns
        -------
        Display
            Itself, with `ax_` and `figure_`.

        Raises
        ------
        ImportError
            If matplotlib is not installed.
        ValueError
            If the number of Axes differs from the number of panels.
        """
        self.ax_ = self._draw(ax)
        axes = np.ravel(self.ax_)
        self.figure_ = axes[0].figure
        self.figure_.align_ylabels(list(axes))
        return self

    def _draw(self, ax: Any) -> Any:
        """Draw, and return the Axes or an array of them."""
        raise NotImplementedError


@dataclass(eq=False, repr=False, kw_only=True)
class OrderDisplay(Display):
    """A display with an order axis, on which predicted fault orders are marked."""

    fault_orders: Any = None
    slip: float = 0.02

    def __post_init__(self) -> None:
        self.fault_orders = _tables.predicted_lines(self.fault_orders, self.slip)


@dataclass(eq=False, repr=False, kw_only=True)
class PowerDisplay(OrderDisplay):
    """Power over the order, by group of recordings and channel.

    Subclasses state the pipeline step of `from_estimator` and the parameters taken from it.
    """

    _step: ClassVar[type]
    _from_step: ClassVar[tuple[str, ...]]

    unit: str | Mapping[str, str] = "unit"
    envelopes: Any = None
    healthy: Any = _drawing.HEALTHY
    scale: str = "dB"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.envelopes = _tables.check_envelopes(self.envelopes)
        check_choice(self.scale, "scale", SCALES)

    @classmethod
    def from_table(
        cls, table: Any, channel: str | Sequence[str] | None = None, **options: Any
    ) -> Self:
        """Draw the mean of the recordings of each label; see the subclasses."""
        raise NotImplementedError

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: Any,
        channel: str | Sequence[str] | None = None,
        *,
        labels: ArrayLike | None = None,
        ax: Any = None,
        **options: Any,
    ) -> Self:
        """Transform recordings by a fitted pipeline, and draw the mean of each label.

        Parameters
        ----------
        estimator : OrderPSD, BinTransformer, or Pipeline with such a step
            Fitted. Steps after the one that is drawn are not used. Envelope channels, `scaling`
            and `stop_bands` are taken from the steps, units from the first recording.
        X : list of Recording
            Recordings, or the input of the first step.
        channel : str or sequence of str, optional
            Channels to draw, as in the column names. Default: all.
        labels : array-like of shape (n_recordings,), optional
            Label of each recording. Default: the mean of all.
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one Axes for each channel.
        **options
            As for the class.

        Returns
        -------
        OrderSpectrumDisplay or OrderBinsDisplay

        Raises
        ------
        TypeError, ValueError
            If the pipeline has no such step, and as for `from_table`.
        """
        name = cls._step.__name__
        wanted = f"{'an' if name[0] in 'AEIO' else 'a'} {name}"
        step, before = _tables.pipeline_until(estimator, lambda s: isinstance(s, cls._step), wanted)
        values = step.transform(X if before is None else before.transform(X))
        table = pd.DataFrame(np.asarray(values), columns=step.get_feature_names_out())
        known = {option: getattr(step, option) for option in cls._from_step}
        known["envelopes"] = _tables.envelopes_of(before)
        known["unit"] = _tables.units_in(X) or "unit"
        return cls.from_table(table, channel, labels=labels, ax=ax, **(known | options))

    def _scaled(self, power: NDArray[np.floating]) -> NDArray[np.floating]:
        return _drawing.decibels(power) if self.scale == "dB" else power

    def _label_power(self, panel: Any, channel: str, quantity: str, per: str = "") -> None:
        """Label the y axis with quantity, channel and unit."""
        kind = self.envelopes.get(channel, self.envelopes.get(channel.rstrip("+-")))
        unit = _tables.unit_of(self.unit, channel, derived=kind is not None)
        quantity, unit = _tables.as_envelope(quantity, unit, kind)
        base = channel if kind is None else channel.removesuffix("_envelope")
        reference = "dB re 1 " if self.scale == "dB" else ""
        unit = f"{reference}{_drawing.squared(unit)}{per}"
        _drawing.label_y(panel, f"{quantity} of {base}", unit)


def bar_style(colour: str) -> dict[str, Any]:
    """Return the style of bars of this colour."""
    return {"color": _drawing.tint(colour, 0.6), "edgecolor": "black", "linewidth": 0.5}
