"""Facts about a recording, a model and its versions, as names with texts."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import sklearn

from emacm._version import __version__
from emacm.models.model_files import parts_of
from emacm.recordings.recording import Recording
from emacm.reports.words import listed, span, speeds
from emacm.resampling.order_resampler import OrderResampler

Facts = list[tuple[str, str]]

_MOST = 12  # channels, classes and entries of meta that are listed
_DIGITS = 16  # of a digest


def recording_facts(recording: Recording, name: str) -> Facts:
    """Return file, duration, revolutions, speed range, channels with rates and units, and meta."""
    speed = np.abs(recording.velocity)
    turned = float(np.abs(np.diff(recording.angle)).sum()) / (2 * np.pi)
    channels = [_channel(recording, channel) for channel in recording.channels]
    meta = [f"{key} = {value}" for key, value in recording.meta.items()]
    return [
        ("File" if hasattr(recording, "path") else "Recording", name),
        ("Length", f"{recording.duration:.4g} s, {turned:.4g} revolutions"),
        ("Speed of the shaft", speeds(float(speed.min()), float(speed.max()))),
        ("Channels", _shortened(channels, "; ")),
        *([("Meta", _shortened(meta))] if meta else []),
        ("Digest", recording.digest[:_DIGITS]),
    ]


def _channel(recording: Recording, name: str) -> str:
    unit = recording.units.get(name)
    return f"{name} [{unit or 'unit not stated'}], {recording.fs[name]:g} Hz"


def model_facts(model: Any, about: Mapping[str, Any] | None, path: Path | None) -> Facts:
    """Return note, file, digest, classes, training ranges and versions of a model.

    Parameters
    ----------
    model : estimator
        Fitted.
    about : mapping, optional
        Of `describe_model`, if the model was read from a file.
    path : Path, optional
        That file.

    Returns
    -------
    list of (str, str)
    """
    here = versions()
    facts = [("Model", type(model).__name__ + ", in memory: not saved to a file")]
    if about is not None and path is not None:
        digest = sha256(path.read_bytes()).hexdigest()[:_DIGITS]
        facts = [("Model", f"{path.name}, saved {about['saved']}"), ("Digest", digest)]
        if about["note"]:
            facts.append(("Note", str(about["note"])))
    facts.append(("States", _shortened([str(label) for label in np.asarray(model.classes_)])))
    ranges = [
        part.training_range_
        for part in parts_of(model)
        if isinstance(part, OrderResampler) and hasattr(part, "training_range_")
    ]
    facts += _training(ranges)
    facts.append(("Versions", ", ".join(f"{name} {version}" for name, version in here.items())))
    saved = {} if about is None else {n: v for n, v in about["versions"].items() if n in here}
    others = [f"{name} {version}" for name, version in saved.items() if version != here[name]]
    if others:
        facts.append(("Saved under", ", ".join(others)))
    return facts


def versions() -> dict[str, str]:
    """Return the versions that compute a report."""
    return {
        "emacm": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "sklearn": sklearn.__version__,
    }


def _training(ranges: list[dict[str, tuple[float, float]]]) -> Facts:
    """Return the ranges of the training recordings of all resamplers together."""
    if not ranges:
        return []
    ends = {
        name: (min(r[name][0] for r in ranges), max(r[name][1] for r in ranges))
        for name in ranges[0]
        if all(name in each for each in ranges)
    }
    low, high = ends["slowest"][0], ends["fastest"][1]
    parts = [speeds(low, high), span(*ends["revolutions"], "revolutions")]
    rates = [span(*ends[name], "Hz") for name in ends if name.startswith("fs of ")]
    parts += list(dict.fromkeys(rates))
    levels = [
        f"{name.removeprefix('level of ')} {span(*ends[name], '').strip()}"
        for name in ends
        if name.startswith("level of ")
    ]
    levels = [f"levels (root mean square): {_shortened(levels)}"] if levels else []
    return [("Trained on", "; ".join([*parts, *levels]))]


def _shortened(texts: list[str], between: str = ", ") -> str:
    more = len(texts) - _MOST
    return between.join(texts[:_MOST]) + (f" and {more} more" if more > 0 else "")


def known_states(model: Any) -> str:
    """Return the states that a model was trained on, in words."""
    return listed(np.asarray(model.classes_).tolist()[:_MOST])
