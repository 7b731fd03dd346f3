"""Probabilities, levels, lists and times in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

_CERTAIN = 0.99  # beyond it, no probability of a model is known more exactly
_WORDS = ((0.99, "very high"), (0.95, "high"), (0.8, "moderate"), (0.0, "low"))
_RPM = 60 / (2 * np.pi)


def percent(probability: float) -> str:
    """Return a probability in per cent; neither 0 nor 100.

    Examples
    --------
    >>> percent(1.0), percent(0.973), percent(0.0004)
    ('above 99 %', '97 %', 'below 1 %')
    """
    if probability > _CERTAIN:
        return "above 99 %"
    return "below 1 %" if probability < 1 - _CERTAIN else f"{100 * probability:.0f} %"


def confidence(probability: float) -> str:
    """Return the confidence in a decision.

    Examples
    --------
    >>> confidence(0.97), confidence(0.4)
    ('high', 'low')
    """
    return next(word for least, word in _WORDS if probability >= least)


def decibels(value: float, unit: str = "dB") -> str:
    """Return a deviation with its sign.

    Examples
    --------
    >>> decibels(13.6), decibels(-4.24, "standard deviations")
    ('+14 dB', '−4.2 standard deviations')
    """
    size = f"{abs(value):.0f}" if unit == "dB" else f"{abs(value):.1f}"
    return f"{'−' if value < 0 else '+'}{size} {unit}"


def listed(names: Sequence[Any], last: str = "and") -> str:
    """Return a list in words.

    Examples
    --------
    >>> listed(["screw", "ring", "cage"])
    'screw, ring and cage'
    """
    texts = [str(name) for name in names]
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} {last} {texts[-1]}"


def span(low: float, high: float, unit: str) -> str:
    """Return a range.

    Examples
    --------
    >>> span(140.0, 160.04, "Hz"), span(20.001, 20.002, "Hz")
    ('140 to 160 Hz', '20 Hz')
    """
    first, last = f"{low:.4g}", f"{high:.4g}"
    return f"{first} {unit}" if first == last else f"{first} to {last} {unit}"


def speeds(low: float, high: float) -> str:
    """Return a range of shaft speeds [rad/s] in rpm.

    Examples
    --------
    >>> speeds(104.72, 157.08)
    '1000 to 1500 rpm'
    """
    return span(low * _RPM, high * _RPM, "rpm")


def when(time: Any, name: str = "") -> str:
    """Return a time, or the value of a counter with its name.

    Examples
    --------
    >>> when(pd.Timestamp("2024-05-01 22:10:03")), when(1200, "cycle")
    ('2024-05-01 22:10', 'cycle 1200')
    """
    if isinstance(time, pd.Timestamp):
        text = f"{time:%Y-%m-%d %H:%M}"
        return text.removesuffix(" 00:00")
    value = f"{time:.9g}" if isinstance(time, float) else str(time)
    return f"{name} {value}".strip()


def channel_name(channel: str) -> str:
    """Return a channel as it was measured, and the direction in words.

    Examples
    --------
    >>> channel_name("torque-"), channel_name("psd__torque")
    ('torque (reverse)', 'torque')
    """
    name = channel.rpartition("__")[2]
    for sign, direction in (("+", "forward"), ("-", "reverse")):
        if name.endswith(sign):
            return f"{name[:-1]} ({direction})"
    return name
