"""Checks of names of channels."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from typing import Any

from emacm._checks import once_hint


def chosen_channels(channels: Any, known: Sequence[str]) -> tuple[str, ...]:
    """Return the channels that the parameter `channels` of an estimator chooses.

    Parameters
    ----------
    channels : sequence of str, or None
        Names of channels in the order wanted; None for all.
    known : sequence of str
        All channels, for None. Whether the names are among them is not checked.

    Returns
    -------
    tuple of str

    Raises
    ------
    TypeError
        If `channels` is a single name, has no order (a set), can be read only once (a generator),
        or holds something that is not a name.
    ValueError
        If it is empty or repeats a name.

    Examples
    --------
    >>> chosen_channels(["torque", "current"], ("current", "speed", "torque"))
    ('torque', 'current')
    """
    if channels is None:
        return tuple(known)
    if isinstance(channels, str):
        raise TypeError(f"channels must be a list of names such as [{channels!r}]; got a text.")
    if not isinstance(channels, Iterable) or isinstance(channels, Mapping | Set | Iterator):
        raise TypeError(
            f"channels must be a list of names such as ['current'], got {channels!r}."
            f"{once_hint(channels)}"
        )
    chosen = tuple(channels)
    for name in chosen:
        if not isinstance(name, str):
            raise TypeError(f"channels must be a list of names, got {name!r} in {chosen!r}.")
    if not chosen or len(set(chosen)) < len(chosen):
        raise ValueError(
            f"channels must name at least one channel, and name each channel once; got "
            f"{list(chosen)}."
        )
    return chosen


def check_channel_names(known: Sequence[Any], channels: Sequence[Any], where: str = "it") -> None:
    """Raise a ValueError if one of `channels` is not among those that are known."""
    missing = [name for name in channels if name not in known]
    if missing:
        raise ValueError(
            f"{where} has no channel {missing[0]!r}; its channels are {list(known)}, expected "
            f"were {list(channels)}. If the names differ, use Recording.rename, or channels = "
            f"{{name: column}} in the Layout of a file."
        )
