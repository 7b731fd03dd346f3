"""Level and defects of channels: constant, clipped, drop-outs.

A channel that is computed when it is read, such as an envelope, is judged by the measured signal
it is computed from. At most 32,768 values in 32 blocks are read, so that a recording that is larger
than memory costs no more than a short one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from emacm.shaft.motion import LazySeries, Series, blocks

Array = NDArray[np.float64]

_BLOCKS, _BLOCK = 32, 1024
_CLIPPED, _HELD = 3, 16  # equal samples in succession: at the extremes, and anywhere
_STRETCHES = 5  # fewer may be coincidence, or the machine at rest
_FEW = 1e-3  # fraction of equal neighbours below which nothing is clipped or lost
_SHARP = 0.3  # of the usual step: a signal that comes to rest has smaller ones
_GAP, _CHANCE = 64, 1e-6  # equal samples of a single gap; probability of so many by coincidence
_ROUGH = 0.1  # of the standard deviation; usual step of a signal that has no plateaus
_NEAR = 8  # samples before and after a gap in which the signal is active
_FINE = 0.02  # of the usual step; smallest step of a signal that noise changes even at standstill
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


def check_channel(
    series: Series, name: str, turning: Sequence[tuple[float, float]] = ()
) -> ChannelCheck:
    """Return the level and the defect of one channel.

    Parameters
    ----------
    series : Series
        The channel.
    name : str
        Its name.
    turning : sequence of (float, float)
        Begin and end of each stroke of the shaft, as fractions of the duration.

    Returns
    -------
    ChannelCheck

    Notes
    -----
    A channel is clipped if it stays at its largest or smallest value at least five times for three
    or more samples, and reaches this value by steps of the usual size. A coarsely quantised signal
    with a smooth maximum reaches it by small steps, so it is not clipped. Drop-outs are stretches
    of 16 or more equal samples, at any value, that begin and end with such steps. A single one of
    64 or more is sufficient where the shaft turns, if the signal has no plateaus and so many equal
    samples are no coincidence. Signals with few values (switches) are left out.

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
    rows, starts = _sampled(series)
    largest, n = float(np.abs(rows).max()), len(series)
    if np.ptp(rows) == 0 and all(np.ptp(b) == 0 and b[0] == rows[0, 0] for _, b in blocks(series)):
        return ChannelCheck(
            0.0, "constant", f"channel {name!r} is constant ({rows[0, 0]:.4g}): cable or sensor?"
        )
    scaled = rows / largest if largest > 0 else rows  # squares of any finite value
    defect, where = _flat_stretches(scaled, starts, [(a * n, b * n) for a, b in turning])
    text = {
        "": "",
        "clipped": f"channel {name!r} is clipped at {where * largest:.4g}",
        "drop-outs": f"channel {name!r} has drop-outs: in {100 * where:.2g} % of the time "
        f"it is constant",
    }[defect]
    return ChannelCheck(float(scaled.std()) * largest, defect, text)


def _sampled(series: Series) -> tuple[Array, NDArray[np.intp]]:
    """Return blocks of a channel, evenly spread, shape (n_blocks, n_times), and their begins."""
    length = len(series)
    if length <= _BLOCKS * _BLOCK:
        return np.asarray(series[:], np.float64)[np.newaxis], np.zeros(1, np.intp)
    starts = np.linspace(0, length - _BLOCK, _BLOCKS).astype(np.intp)
    blocks_of = [series[start : start + _BLOCK] for start in starts.tolist()]
    return np.array(blocks_of, np.float64), starts


def _flat_stretches(
    rows: Array, starts: NDArray[np.intp], turning: Sequence[tuple[float, float]]
) -> tuple[str, float]:
    """Return the defect, and the value it is clipped at or the fraction of time it is constant.

    Parameters
    ----------
    rows : ndarray of shape (n_blocks, n_times)
        Blocks of the channel.
    starts : ndarray of shape (n_blocks,)
        Samples at which they begin.
    turning : sequence of (float, float)
        Samples at which strokes of the shaft begin and end.

    Returns
    -------
    defect : {"", "clipped", "drop-outs"}
    where : float
    """
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
    outer, step = np.array([around[first], around[last + 1]]), _sharp_step(steps[~equal])
    sharp = outer.max(axis=0) > step
    lengths = last - first + 1  # samples
    width = rows.shape[1] + 1
    values = rows[first // width, first % width]
    for extreme in (rows.max(), rows.min()):
        here = (lengths >= _CLIPPED) & (values == extreme)
        if np.count_nonzero(here & sharp) >= max(_STRETCHES, 0.5 * np.count_nonzero(here)):
            return "clipped", float(extreme)
    held = lengths >= _HELD
    share = float(lengths[held].sum() / rows.size)
    if np.count_nonzero(held & sharp) >= _STRETCHES and 0.01 < share < _DIGITAL:
        return "drop-outs", share
    # A single gap counts while the shaft turns, in a signal whose samples differ otherwise.
    is_long = lengths >= _GAP
    usual = float(np.median(steps[~equal]))
    if not is_long.any() or usual < _ROUGH * rows.std():
        return "", 0.0
    begin = starts[first // width] + first % width
    turned, is_within = _while_turning(begin, begin + lengths, turning)
    n_long = int((lengths[is_long] - 1).sum())
    often = max((equal.sum() - n_long) / (equal.size - n_long), 1 / equal.size)
    is_rare = np.log(equal.size) + (turned - 1) * np.log(often) < np.log(_CHANCE)
    # Near its ends the signal is active, unlike one that comes to rest, or the shaft is at rest.
    active = maximum_filter1d(around, 2 * _NEAR + 1)[[first, last + 1]] > step
    is_unknown = (outer == 0) | ~is_within  # beyond a block
    is_cut = (active | is_unknown).all(axis=0) & active.any(axis=0)
    is_cut |= float(steps[~equal].min()) <= _FINE * usual
    share = float(turned[(turned >= _GAP) & is_rare & is_cut].sum() / rows.size)
    return ("drop-outs", share) if 0.01 < share < _DIGITAL else ("", 0.0)


def _while_turning(
    begin: NDArray[np.intp], end: NDArray[np.intp], turning: Sequence[tuple[float, float]]
) -> tuple[Array, NDArray[np.bool_]]:
    """Return how many samples of stretches lie within strokes, and whether their ends do.

    Shapes (n_stretches,) and (2, n_stretches).
    """
    ends = np.array([begin, end])
    turned = np.zeros(len(begin))
    is_within = np.zeros(ends.shape, dtype=bool)
    for low, high in turning:
        turned += np.clip(np.minimum(end, high) - np.maximum(begin, low), 0, None)
        is_within |= (ends > low) & (ends < high)
    return turned, is_within


def _sharp_step(steps: Any) -> float:
    """Return the size above which a step is none of a signal that comes to rest."""
    return float(max(_SHARP * np.median(steps), 1.5 * steps.min()))
