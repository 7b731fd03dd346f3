"""What is known about a recording, or about a fit, as a value: text is for people."""

from __future__ import annotations

import warnings
from dataclasses import dataclass


@dataclass(frozen=True)
class Statement:
    """What is known about a recording, a file or a fit.

    Programs read the fields; the text is for people, and its wording may change.

    Attributes
    ----------
    kind : str
        What it is about: "level", "speed", "new line", "groups" and so on; the same words in all
        versions 1.x.
    channel : str
        The channel that it concerns; "" if it concerns none, or several.
    text : str
        The sentence, with units.
    severe : bool
        Whether a decision should not be relied on.
    value, limit : float or None
        The number that it states, and the limit that this number exceeds; None where there is none.

    Examples
    --------
    >>> stated = Statement("level", "vibration", "channel 'vibration' 60 dB above training", True)
    >>> stated.channel, stated.severe
    ('vibration', True)
    """

    kind: str
    channel: str
    text: str
    severe: bool = False
    value: float | None = None
    limit: float | None = None

    def __str__(self) -> str:
        """Return the text."""
        return self.text


class EmacmWarning(UserWarning):
    """A warning of emacm; `statement` says what it is about.

    Parameters
    ----------
    statement : Statement
        What is stated.

    Examples
    --------
    >>> import warnings
    >>> warnings.simplefilter("ignore", EmacmWarning)  # all of emacm, and nothing else
    >>> EmacmWarning(Statement("groups", "", "fit was called without groups")).statement.kind
    'groups'
    """

    def __init__(self, statement: Statement) -> None:
        super().__init__(statement)
        self.statement = statement


def warn(kind: str, text: str, *, channel: str = "", stacklevel: int = 2) -> None:
    """Warn of a statement; `stacklevel` counts from the caller, as in `warnings.warn`."""
    statement = Statement(kind, channel, text)
    warnings.warn(EmacmWarning(statement), stacklevel=stacklevel + 1)
