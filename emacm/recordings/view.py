"""A recording as a table in a notebook."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from emacm.recordings.recording import Recording


def recording_html(recording: Recording) -> str:
    """Return the channels, the shaft and the meta of a recording as an HTML table.

    Parameters
    ----------
    recording : Recording
        The recording; all its channels are read.

    Returns
    -------
    str
    """
    rows = [
        (name, recording.units.get(name, ""), recording.fs[name], recording.signals[name])
        for name in recording.channels
    ]
    unit = "rad" if recording.reference == "angle" else "rad/s"
    shaft = recording.angle if recording.reference == "angle" else recording.velocity
    rows.append((f"shaft {recording.reference}", unit, recording.shaft_fs, shaft))
    titles = ("channel", "unit", "rate [Hz]", "samples", "lowest", "mean", "highest")
    head = "".join(f"<th>{title}</th>" for title in titles)
    body = "".join(_row(*row) for row in rows)
    turned = float(np.abs(np.diff(recording.angle)).sum()) / (2 * np.pi)
    facts = [f"{recording.duration:.6g} s", f"{turned:.6g} revolutions"]
    facts += [f"{key}={value!r}" for key, value in recording.meta.items()]
    return (
        f"<table><caption>Recording: {escape(', '.join(facts))}</caption>"
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    )


def _row(name: str, unit: str, fs: float, values: Any) -> str:
    numbers = (values.min(), values.mean(dtype=np.float64), values.max())
    cells = [escape(name), escape(unit), f"{fs:.9g}", f"{len(values)}"]
    cells += [f"{number:.4g}" for number in numbers]
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
