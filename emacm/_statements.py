"""Sentences about recordings and results, with the numbers that they state."""

from __future__ import annotations

from typing import NamedTuple


class Statement(NamedTuple):
    """A sentence, with the number that it states and the limit that this number exceeds.

    Attributes
    ----------
    text : str
        The sentence, with its unit.
    severe : bool
        Whether a decision should not be relied on; such statements are warned of.
    value, limit : float or None
        The number, and its limit in the training or in a standard; None where there is none.
    """

    text: str
    severe: bool = False
    value: float | None = None
    limit: float | None = None
