"""Facts about a recording, a model and its versions, as names with texts."""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from emacm._saved import installed_versions
from emacm.decisions.pipelines import final_estimator
from emacm.models.model_files import model_description
from emacm.recordings.recording import Recording


def percent(probability: float) -> str:
    """Return a probability in per cent; beyond 1 and 99, none is known more exactly.

    Examples
    --------
    >>> percent(1.0), percent(0.973), percent(0.0004)
    ('above 99 %', '97 %', 'below 1 %')
    """
    value = 100 * probability
    if 1 <= value <= 99:
        return f"{value:.0f} %"
    return "above 99 %" if value > 99 else "below 1 %"


def confidence(probability: float) -> str:
    """Return the confidence in a decision.

    Examples
    --------
    >>> confidence(0.97), confidence(0.4)
    ('high', 'low')
    """
    words = ((0.99, "very high"), (0.95, "high"), (0.8, "moderate"))
    return next((word for least, word in words if probability >= least), "low")


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
    return f" {last} ".join(filter(None, [", ".join(texts[:-1]), *texts[-1:]]))


def span(low: float, high: float, unit: str) -> str:
    """Return a range.

    Examples
    --------
    >>> span(140.0, 160.04, "Hz"), span(20.001, 20.002, "Hz"), span(10000.0, 10000.0, "Hz")
    ('140 to 160 Hz', '20 Hz', '10 kHz')
    """
    if unit == "Hz" and low >= 1000:
        low, high, unit = low / 1000, high / 1000, "kHz"
    first, last = (np.format_float_positional(x, 4, False, False, "-") for x in (low, high))
    return f"{first} {unit}" if first == last else f"{first} to {last} {unit}"


def when(time: Any, name: str = "") -> str:
    """Return a time, or the value of a counter with its name.

    Examples
    --------
    >>> when(pd.Timestamp("2024-05-01 22:10:03")), when(1200, "cycle")
    ('2024-05-01 22:10', 'cycle 1200')
    """
    if isinstance(time, pd.Timestamp):
        return f"{time:%Y-%m-%d %H:%M}".removesuffix(" 00:00")
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


Facts = list[tuple[str, str]]


def decisions_of(model: Any) -> list[Any]:
    """Return the decisions that a fitted classifier can make."""
    return np.asarray(getattr(final_estimator(model), "decisions_", model.classes_)).tolist()


def healthy_label(
    labels: Sequence[Any], name: Any, parameter: str, *, required: bool = True
) -> Any:
    """Return the label of the healthy state: that of this name, by default "healthy" or "normal".

    Raises
    ------
    ValueError
        If there is none. By default, None is returned for `name` = None if it is not `required`.

    Examples
    --------
    >>> healthy_label(["normal", "worn"], None, "--healthy"), healthy_label([0, 1], "0", "healthy")
    ('normal', 0)
    """
    names = ("healthy", "normal") if name is None else (str(name),)
    found = [label for text in names for label in labels if str(label) == text]
    if not found and (required or name is not None):
        known = sorted({str(label) for label in labels})
        raise ValueError(
            f"{parameter} must name the healthy state (default: healthy or normal), one of "
            f"{known}; got {name!r}."
        )
    return found[0] if found else None


def recording_facts(recording: Recording, name: str) -> Facts:
    """Return file, duration, revolutions, speed range, channels with rates and units, and meta."""
    speed = np.abs(recording.velocity) * 30 / np.pi
    turned = float(np.abs(np.diff(recording.angle)).sum()) / (2 * np.pi)
    channels = [
        f"{channel} [{recording.units.get(channel) or 'unit not stated'}], {span(rate, rate, 'Hz')}"
        for channel, rate in recording.fs.items()
    ]
    meta = [f"{key} = {value}" for key, value in recording.meta.items()]
    return [
        ("File" if hasattr(recording, "path") else "Recording", name),
        ("Length", f"{recording.duration:.4g} s, {turned:.4g} revolutions"),
        ("Speed of the shaft", span(float(speed.min()), float(speed.max()), "rpm")),
        ("Channels", _shortened(channels, "; ")),
        *([("Meta", _shortened(meta))] if meta else []),
        ("Digest", recording.digest[:16]),
    ]


def model_facts(model: Any, path: Path | None = None) -> Facts:
    """Return note, file, digest and classes of a model, and the versions installed here.

    Parameters
    ----------
    model : estimator
        Fitted.
    path : Path, optional
        The file from which it was read.

    Returns
    -------
    list of (str, str)
    """
    facts = [("Model", type(model).__name__ + ", in memory: not saved to a file")]
    if path is not None:
        about, digest = model_description(path), sha256(path.read_bytes()).hexdigest()[:16]
        facts = [("Model", f"{path.name}, saved {about['saved']}"), ("Digest", digest)]
        facts += [("Note", str(about["note"]))] if about["note"] else []
    facts.append(("States", _shortened([str(label) for label in model.classes_])))
    versions, names = installed_versions(), ("emacm", "python", "numpy", "sklearn")
    return [*facts, ("Versions", ", ".join(f"{name} {versions[name]}" for name in names))]


def _shortened(texts: list[str], between: str = ", ") -> str:
    """Return the first 12 channels, classes or entries of meta, and how many are left out."""
    more = len(texts) - 12
    return between.join(texts[:12]) + (f" and {more} more" if more > 0 else "")
