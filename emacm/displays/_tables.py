"""What is to be drawn: checked, chosen from tables and fitted pipelines, averaged by label."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.pipeline import Pipeline

from emacm._checks import check_number, check_real_array
from emacm.orders.columns import BinBlock, OrderBlock
from emacm.recordings.inputs import check_channel_names

Block = TypeVar("Block", OrderBlock, BinBlock)


def check_values(
    values: ArrayLike, name: str, shape: tuple[int | None, ...], *, least: float | None = None
) -> NDArray[np.floating]:
    """Return finite numbers of this shape, of at least `least`; None stands for any length.

    Raises
    ------
    TypeError
        If they are no numbers.
    ValueError
        If their shape is another, one is not finite or too low; the message says where.
    """
    array = check_real_array(values, name)
    if array.ndim != len(shape) or any(
        expected not in (None, came) for expected, came in zip(shape, array.shape, strict=True)
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
        If there are not as many.
    """
    array = np.asarray(labels)
    if array.shape != (n_recordings,):
        raise ValueError(
            f"{name} must hold one label for each of {n_recordings} recordings, got shape "
            f"{array.shape}."
        )
    return array


def check_fault_orders(fault_orders: Mapping[str, float] | None) -> dict[str, float]:
    """Return the orders to be marked, by name.

    Raises
    ------
    TypeError
        If it is no mapping, or an order no number.
    ValueError
        If an order is negative or not finite.
    """
    if fault_orders is not None and not isinstance(fault_orders, Mapping):
        raise TypeError(
            f"fault_orders must map names to orders, as {{'BPFI': 6.123}}, got {fault_orders!r}."
        )
    return {
        str(name): check_number(order, f"fault order {name!r}", at_least=0)
        for name, order in (fault_orders or {}).items()
    }


def channel_blocks(
    blocks: Sequence[Block] | None, channel: str | Sequence[str] | None, *, remedy: str
) -> list[Block]:
    """Choose the columns of one channel, of several, or of all.

    Parameters
    ----------
    blocks : sequence of OrderBlock or BinBlock, or None
        What the names of the columns tell; None if they tell nothing.
    channel : str, sequence of str or None
        Channels to choose; None for all.
    remedy : str
        What is said where `blocks` is None.

    Returns
    -------
    list of OrderBlock or BinBlock

    Raises
    ------
    ValueError
        If there is no axis, or no such channel.
    """
    if blocks is None:
        raise ValueError(f"psd carries no order axis; {remedy}.")
    known = {block.channel: block for block in blocks}
    wanted = list(known) if channel is None else channel_list(channel)
    check_channel_names(list(known), wanted, "psd")
    return [known[name] for name in wanted]


def channel_list(channel: str | Sequence[str]) -> list[str]:
    """Return the names of one channel or of several.

    Raises
    ------
    ValueError
        If there is none, or one comes twice.
    """
    names = [channel] if isinstance(channel, str) else list(channel)
    if not names or len(set(names)) < len(names):
        raise ValueError(f"channel must name at least one channel, and each once; got {names}.")
    return names


def unit_of(unit: str | Mapping[str, str], channel: str) -> str:
    """Return the unit of a channel; columns by direction, ``current+``, have that of theirs."""
    if isinstance(unit, str):
        return unit
    return unit.get(channel, unit.get(channel.rstrip("+-"), "unit"))


def means_by_label(
    values: ArrayLike, labels: ArrayLike | None, otherwise: str
) -> dict[str, NDArray[np.floating]]:
    """Average the recordings of each label; all of them are called `otherwise` without labels.

    Raises
    ------
    ValueError
        If there is no recording, a value is not finite, or a label is missing.
    """
    table = check_values(values, "psd", (None, None))
    if not len(table):
        raise ValueError("psd holds no recording; at least one is needed.")
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
        Tells whether a step is the one.
    wanted : str
        What it is, for the error.

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
