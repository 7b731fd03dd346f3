"""Values to be drawn: checks, channels and means of a table, steps of a fitted pipeline."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.pipeline import Pipeline

from emacm._checks import check_number, check_real_array
from emacm.displays._drawing import squared
from emacm.machine.fault_orders import named_orders, slip_ranges
from emacm.orders.columns import BinBlock, OrderBlock
from emacm.recordings.envelope import EnvelopeSeries
from emacm.recordings.envelope_detector import EnvelopeDetector, envelope_names
from emacm.recordings.inputs import check_channel_names
from emacm.recordings.recording import Recording

Block = TypeVar("Block", OrderBlock, BinBlock)

ENVELOPES = ("amplitude", "squared")


def check_values(
    values: ArrayLike, name: str, shape: tuple[int | None, ...], *, least: float | None = None
) -> NDArray[np.floating]:
    """Return finite numbers of this shape, of at least `least`; None stands for any length.

    Raises
    ------
    TypeError
        If they are not numeric.
    ValueError
        If the shape differs, or a value is not finite or too low; the message gives its index.
    """
    array = check_real_array(values, name)
    if array.ndim != len(shape) or any(
        expected not in (None, found) for expected, found in zip(shape, array.shape, strict=True)
    ):
        wanted = ", ".join("n" if length is None else str(length) for length in shape)
        comma = "," if len(shape) == 1 else ""
        raise ValueError(f"{name} must have shape ({wanted}{comma}), got {array.shape}.")
    for bad, words in (
        (~np.isfinite(array), "be finite"),
        (np.zeros_like(array, bool) if least is None else array < least, f"be at least {least}"),
    ):
        if bad.any():
            place = tuple(int(i[0]) for i in np.nonzero(bad))
            where = place[0] if len(place) == 1 else place
            raise ValueError(
                f"{name} must {words}, got {array[place]} at index {where}. Leave it out."
            )
    return array


def check_labels(labels: ArrayLike, n_recordings: int, name: str = "labels") -> NDArray[Any]:
    """Return one label for each recording.

    Raises
    ------
    ValueError
        If the number of labels differs.
    """
    array = np.asarray(labels)
    if array.shape != (n_recordings,):
        raise ValueError(
            f"{name} must hold one label for each of {n_recordings} recordings, got shape "
            f"{array.shape}."
        )
    return array


def check_upper_order(max_order: float | None) -> float | None:
    """Return the highest order to be drawn; None stands for all.

    Raises
    ------
    TypeError, ValueError
        If it is not a positive number.
    """
    return None if max_order is None else check_number(max_order, "max_order", above=0)


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


def channel_blocks(
    blocks: Sequence[Block] | None, channel: str | Sequence[str] | None
) -> list[Block]:
    """Choose the columns of one channel, of several, or of all.

    Parameters
    ----------
    blocks : sequence of OrderBlock or BinBlock, or None
        Columns of each channel, read from their names; None if names have another form.
    channel : str, sequence of str or None
        Channels to choose; None for all.

    Returns
    -------
    list of OrderBlock or BinBlock

    Raises
    ------
    ValueError
        If there is no order axis, or no such channel.
    """
    if blocks is None:
        raise ValueError(
            "the table has no order axis; pass the result of OrderPSD (or of BinTransformer under "
            "set_output(transform='pandas')) with its column names, or use from_estimator."
        )
    known = {block.channel: block for block in blocks}
    wanted = list(known) if channel is None else channel_list(channel)
    check_channel_names(list(known), wanted, "the table")
    return [known[name] for name in wanted]


def channel_list(channel: str | Sequence[str]) -> list[str]:
    """Return the names of one channel or of several.

    Raises
    ------
    ValueError
        If there is none, or a name is repeated.
    """
    names = [channel] if isinstance(channel, str) else list(channel)
    if not names or len(set(names)) < len(names):
        raise ValueError(f"channel must name at least one channel, and each once; got {names}.")
    return names


def check_envelopes(envelopes: Mapping[str, str] | None) -> dict[str, str]:
    """Return which channels are envelopes, and whether of amplitude or squared.

    Raises
    ------
    TypeError, ValueError
        If it is not a mapping to "amplitude" or "squared".
    """
    known = {} if envelopes is None else envelopes
    if not isinstance(known, Mapping) or any(kind not in ENVELOPES for kind in known.values()):
        raise ValueError(
            f"envelopes must map channels to 'amplitude' or 'squared', as "
            f"{{'vibration': 'amplitude'}}; got {envelopes!r}."
        )
    return dict(known)


def envelopes_of(steps: Any) -> dict[str, str]:
    """Return the envelope channels that the steps of a fitted pipeline compute."""
    return {
        name: ENVELOPES[bool(step.squared)]
        for _, step in getattr(steps, "steps", ())
        if isinstance(step, EnvelopeDetector)
        for channel, band in step.bands_.items()
        for name in envelope_names(channel, band, step.suffix)
    }


def envelopes_in(recording: Recording) -> dict[str, str]:
    """Return the channels of a recording that are envelopes."""
    return {
        name: ENVELOPES[bool(series.squared)]
        for name, series in recording.series.items()
        if isinstance(series, EnvelopeSeries)
    }


def units_in(X: Any) -> dict[str, str]:
    """Return the units of the channels of the first recording; none for other input."""
    first = X[0] if isinstance(X, Sequence) and len(X) else None
    return dict(first.units) if isinstance(first, Recording) else {}


def as_envelope(quantity: str, unit: str, kind: str | None) -> tuple[str, str]:
    """Return the quantity and the unit of an envelope; those given if `kind` is None.

    Examples
    --------
    >>> as_envelope("PSD", "m/s²", "amplitude"), as_envelope("", "V", "squared")
    (('envelope order spectrum', 'm/s²'), ('squared envelope', 'V²'))
    """
    if kind is None:
        return quantity, unit
    words = f"envelope {'order spectrum' if quantity == 'PSD' else quantity}".rstrip()
    return (f"squared {words}", squared(unit)) if kind == "squared" else (words, unit)


def unit_of(unit: str | Mapping[str, str], channel: str, *, derived: bool = False) -> str:
    """Return the unit of a channel; columns by direction, ``current+``, have that of the channel.

    Parameters
    ----------
    unit : str or mapping of str to str
        Unit of all channels, or of each.
    channel : str
        Name of the channel.
    derived : bool
        Whether the channel is an envelope, which may have a suffix: ``vibration_envelope``.

    Returns
    -------
    str
        "unit" if it is not known.
    """
    if isinstance(unit, str):
        return unit
    if not isinstance(unit, Mapping):
        raise TypeError(f"unit must be text, or map channels to text; got {unit!r}.")
    first = [name for name in unit if derived and channel.startswith(name)]
    base = max(first, key=len) if first else channel.rstrip("+-")
    return unit.get(channel, unit.get(base, "unit"))


def means_by_label(
    values: ArrayLike, labels: ArrayLike | None, otherwise: str
) -> dict[str, NDArray[np.floating]]:
    """Average the recordings of each label; without labels, all under the name `otherwise`.

    Raises
    ------
    ValueError
        If there is no recording, a value is not finite, or a label is missing.
    """
    table = check_values(values, "the table", (None, None))
    if not len(table):
        raise ValueError("the table holds no recording; at least one is needed.")
    groups = check_labels(np.full(len(table), otherwise) if labels is None else labels, len(table))
    missing = np.flatnonzero(pd.isna(groups))
    if len(missing):
        raise ValueError(f"labels must name every recording, got none for recording {missing[0]}.")
    return {str(name): table[groups == name].mean(axis=0) for name in np.unique(groups)}


def pipeline_until(
    estimator: Any, matches: Callable[[Any], bool], wanted: str
) -> tuple[Any, Any | None]:
    """Find a step of a fitted pipeline.

    Parameters
    ----------
    estimator : estimator or Pipeline
        Where to look.
    matches : callable
        Whether a step is the wanted one.
    wanted : str
        Its name, for the message.

    Returns
    -------
    step : estimator
        The last one that matches.
    before : Pipeline or None
        The steps before it, if there are any.

    Raises
    ------
    ValueError
        If no step matches.
    """
    if not isinstance(estimator, Pipeline):
        if matches(estimator):
            return estimator, None
        raise ValueError(f"estimator must be or contain {wanted}, got {estimator!r}.")
    places = [i for i, (_, step) in enumerate(estimator.steps) if matches(step)]
    if not places:
        raise ValueError(
            f"no step of the pipeline is {wanted}; its steps are {list(estimator.named_steps)}."
        )
    last = places[-1]
    return estimator[last], (estimator[:last] if last else None)
