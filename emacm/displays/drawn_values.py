"""Values to be drawn: checks, channels and means of a table, steps of a fitted pipeline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_number
from emacm.decisions.pipelines import parts_of
from emacm.displays.drawing import Display, squared
from emacm.envelopes.envelope import EnvelopeSeries
from emacm.envelopes.envelope_detector import EnvelopeDetector, envelope_names
from emacm.machine.fault_orders import named_orders, slip_ranges
from emacm.recordings.inputs import check_channel_names
from emacm.recordings.recording import Recording


def check_values(
    values: ArrayLike, name: str, shape: tuple[int | None, ...], *, least: float = -np.inf
) -> NDArray[np.floating]:
    """Return finite numbers of this shape, of at least `least`; None stands for any length.

    Raises
    ------
    ValueError
        If the shape differs, or a value is not a number, not finite or too low; the message gives
        its index.
    """
    array = np.asarray(values, np.float64)
    wanted = tuple(n if k is None else k for k, n in zip(shape, array.shape, strict=False))
    if array.ndim != len(shape) or array.shape != wanted:
        raise ValueError(f"{name} must have shape {shape} (None: any), got {array.shape}.")
    invalid = np.argwhere(~np.isfinite(array) | (array < least)).tolist()
    if invalid:
        value = array[tuple(invalid[0])]
        raise ValueError(f"{name} must be finite, at least {least:g}, got {value} at {invalid[0]}.")
    return array


def predicted_lines(
    fault_orders: pd.DataFrame | Mapping[str, float] | None, slip: float
) -> pd.DataFrame:
    """Return the fault orders to be marked, with their slip ranges.

    Parameters
    ----------
    fault_orders : DataFrame of `emacm.fault_orders`, mapping of str to float, or None
        Orders by name. In a mapping every order may slip.
    slip : float
        Largest relative slip: a line that slips may be lower or higher by this fraction of its
        order.

    Returns
    -------
    DataFrame of shape (n_lines, 3)
        Columns "order", "low" and "high" [orders]; index: names.

    Raises
    ------
    TypeError
        If `fault_orders` is neither a table of `emacm.fault_orders` nor a mapping.
    ValueError
        If an order is not positive, or `slip` is not within [0, 1).
    """
    check_number(slip, "slip", at_least=0, below=1)
    if fault_orders is None or not len(fault_orders):
        return pd.DataFrame({"order": [], "low": [], "high": []}, dtype=float)
    names, low, high = slip_ranges(fault_orders, slip=slip)
    _, orders = named_orders(fault_orders)
    return pd.DataFrame({"order": orders, "low": low, "high": high}, index=names)


def envelopes_of(estimator: Any) -> dict[str, str]:
    """Return the envelope channels that the steps of a fitted pipeline compute."""
    return {
        name: "squared" if step.squared else "amplitude"
        for step in parts_of(estimator)
        if isinstance(step, EnvelopeDetector)
        for channel, band in getattr(step, "bands_", {}).items()
        for name in envelope_names(channel, band)
    }


def envelopes_in(recording: Recording) -> dict[str, str]:
    """Return the channels of a recording that are envelopes."""
    return {
        name: "squared" if series.squared else "amplitude"
        for name, series in recording.series.items()
        if isinstance(series, EnvelopeSeries)
    }


def quantity_of(
    quantity: str, channel: str, units: str | Mapping[str, str], envelopes: Mapping[str, str]
) -> tuple[str, str]:
    """Return a quantity of a channel in words, and the unit of the channel.

    Parameters
    ----------
    quantity : str
        Such as "PSD"; empty for the signal itself.
    channel : str
        Name of the channel; columns by direction, ``current+``, have the unit of the channel, and
        envelopes, ``vibration_500-900Hz``, that of the longest name that they begin with.
    units : str or mapping of str to str
        Unit of all channels, or of each.
    envelopes : mapping of str to {"amplitude", "squared"}
        Channels that are envelopes.

    Returns
    -------
    words, unit : str
        The unit is "unit" if it is not known.

    Examples
    --------
    >>> quantity_of("PSD", "vib_5-9Hz", {"vib": "g"}, {"vib_5-9Hz": "squared"})
    ('squared envelope order spectrum of vib_5-9Hz', 'g²')
    >>> quantity_of("", "current+", {"current": "A"}, {})
    ('current+', 'A')
    """
    base = channel.rstrip("+-")
    kind = envelopes.get(base)
    if isinstance(units, str):
        unit = units
    else:
        first = [name for name in units if kind is not None and channel.startswith(name)]
        unit = units.get(channel) or units.get(max(first, key=len, default=base), "unit")
    if kind is not None:
        quantity = f"envelope {'order spectrum' if quantity == 'PSD' else quantity}".rstrip()
    if kind == "squared":
        quantity, unit = f"squared {quantity}", squared(unit)
    return (f"{quantity} of {channel}" if quantity else channel), unit


@dataclass(eq=False, repr=False, kw_only=True)
class OrderDisplay(Display):
    """A display with an order axis, on which predicted fault orders are marked."""

    fault_orders: Any = None
    slip: float = 0.02

    def __post_init__(self) -> None:
        self.fault_orders = predicted_lines(self.fault_orders, self.slip)


def chosen_channels(recording: Any, channels: Sequence[str] | None) -> list[str]:
    """Return the channels of one recording to be drawn; None stands for all.

    Raises
    ------
    TypeError, ValueError
        If it is not one recording, or has no such channel.
    """
    if not isinstance(recording, Recording):
        raise TypeError(f"recording must be one Recording, got {type(recording).__name__}.")
    chosen = list(recording.channels if channels is None else channels)
    check_channel_names(recording.channels, chosen, "the recording")
    return chosen
