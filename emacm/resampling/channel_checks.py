"""Level and defects of channels: constant, clipped, drop-outs.

A channel that is computed when it is read, such as an envelope, is judged by the measured signal
it is computed from. At most 32,768 values in 32 blocks are read, so that a recording that is larger
than memory costs no more than a short one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm.shaft.motion import LazySeries, Series, blocks

Array = NDArray[np.float64]

_BLOCKS, _BLOCK = 32, 1024
_CLIPPED, _HELD = 3, 16  # equal samples in succession: at the extremes, and anywhere
_STRETCHES = 5  # fewer may be coincidence, or the machine at rest
_FEW = 1e-3  # fraction of equal neighbours below which nothing is clipped or lost
_SHARP = 0.3  # of the usual step: a signal that comes to rest has smaller ones
_DIGITAL = 0.9  # fraction of time at constant values above which a signal is a switch


class ChannelCheck(NamedTuple):
    """Level and defect of one channel.

    Attributes
    ----------
    level : float
        Root mean square of the deviations from the mean, in the unit of the channel.
    defect : {"", "constant", "clipped", "drop-outs"}
        What is wrong; empty if nothing.
    text : str
        Description of the defect.
    """

    level: float
    defect: str
    text: str


def check_channel(series: Series, name: str) -> ChannelCheck:
    """Return the level and the defect of one channel.

    Parameters
    ----------
    series : Series
        The channel.
    name : str
        Its name.

    Returns
    -------
    ChannelCheck

    Notes
    -----
    A channel is clipped if it stays at its largest or smallest value at least five times for three
    or more samples, and reaches this value by steps of the usual size. A coarsely quantised signal
    with a smooth maximum reaches it by small steps, so it is not clipped. Drop-outs are stretches
    of 16 or more equal samples, at any value, that begin and end with such steps. Signals with few
    values (switches) are left out.

    Examples
    --------
    >>> wave = np.sin(np.arange(4000.0))
    >>> check_channel(np.clip(wave, -0.5, 0.5), "current").text
    "channel 'current' is clipped at 0.5"
    >>> check_channel(np.zeros(100), "current").defect
    'constant'
    """
    if isinstance(series, LazySeries) and series.sources:
        series = series.sources[0]
    rows = _sampled(series)
    largest = float(np.abs(rows).max())
    if np.ptp(rows) == 0 and all(np.ptp(b) == 0 and b[0] == rows[0, 0] for _, b in blocks(series)):
        return ChannelCheck(
            0.0, "constant", f"channel {name!r} is constant ({rows[0, 0]:.4g}): cable or sensor?"
        )
    scaled = rows / largest if largest > 0 else rows  # squares of any finite value
    defect, where = _flat_stretches(scaled)
    text = {
        "": "",
        "clipped": f"channel {name!r} is clipped at {where * largest:.4g}",
        "drop-outs": f"channel {name!r} has drop-outs: in {100 * where:.2g} % of the time "
        f"it is constant",
    }[defect]
    return ChannelCheck(float(scaled.std()) * largest, defect, text)


def _sampled(series: Series) -> Array:
    """Return blocks of a channel, evenly spread, shape (n_blocks, n_times)."""
    length = len(series)
    if length <= _BLOCKS * _BLOCK:
        return np.asarray(series[:], np.float64)[np.newaxis]
    starts = np.linspace(0, length - _BLOCK, _BLOCKS).astype(int).tolist()
    return np.array([series[start : start + _BLOCK] for start in starts], np.float64)


def _flat_stretches(rows: Array) -> tuple[str, float]:
    """Return the defect, and the value it is clipped at or the fraction of time it is constant."""
    steps = np.abs(np.diff(rows, axis=1))
    equal = steps == 0
    if equal.mean() < _FEW or equal.all():
        return "", 0.0
    # Stretches of equal samples; a column of other steps keeps the blocks apart.
    edge = np.zeros((len(rows), 1))
    flat = np.pad(equal, ((0, 0), (1, 1))).ravel().astype(np.int8)
    changes = np.diff(flat)
    first, last = np.flatnonzero(changes == 1), np.flatnonzero(changes == -1)
    around = np.hstack([edge, steps, edge]).ravel()  # the outermost steps are not known
    sharp = np.maximum(around[first], around[last + 1]) > _sharp_step(steps[~equal])
    lengths = last - first + 1  # samples
    width = rows.shape[1] + 1
    values = rows[first // width, first % width]
    for extreme in (rows.max(), rows.min()):
        here = (lengths >= _CLIPPED) & (values == extreme)
        if np.count_nonzero(here & sharp) >= max(_STRETCHES, 0.5 * np.count_nonzero(here)):
            return "clipped", float(extreme)
    held = lengths >= _HELD
    share = float(lengths[held].sum() / rows.size)
    lost = np.count_nonzero(held & sharp) >= _STRETCHES and 0.01 < share < _DIGITAL
    return ("drop-outs", share) if lost else ("", 0.0)


def _sharp_step(steps: Any) -> float:
    """Return the size above which a step is none of a signal that comes to rest."""
    return float(max(_SHARP * np.median(steps), 1.5 * steps.min()))
