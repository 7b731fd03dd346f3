"""Faults named from the geometry of a machine, without training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._checks import check_count, check_number, located
from emacm.conditions.healthy import are_recordings, check_rates, common_rates
from emacm.machine.fault_lines import SETTINGS, FaultLines, FaultSeries, LineLevels, fault_series
from emacm.machine.parts import Part
from emacm.models.recipes import bearing_recipe, highest_order
from emacm.orders.columns import column_names, parse_order_columns
from emacm.recordings.inputs import as_recordings, check_channel_names, described
from emacm.recordings.recording import Recording

NONE = "none"
EFFECT = 3.0  # dB; see the notes of find_faults
SINGLE = 12.0  # dB; see the notes of find_faults
_LONGEST, _SHORTEST = 25, 10  # revolutions of a segment
_BACKGROUND = 0.5  # orders
_SIDEBANDS = 3.0  # dB, by which sidebands are above the background where they are mentioned
_FEW = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine")


def find_faults(
    X: Any,
    parts: Part | Mapping[str, float] | Sequence[Part | Mapping[str, float]],
    *,
    harmonics: int = 3,
    slip: float = 0.02,
    false_alarm: float = 0.01,
    channels: Sequence[str] | None = None,
    healthy: Any = None,
) -> pd.DataFrame:
    """Name the fault of each recording and channel from the geometry of the machine.

    No training is needed. A fault is named if its lines are significantly above the local
    background (p-value) and far enough above it (effect size).

    Parameters
    ----------
    X : list of Recording, or table
        Vibration as measured; prewhitening, envelope, resampling and spectra are those of
        `bearing_recipe`, with segments of 25 revolutions, or of as many whole revolutions as a
        shorter recording has, at least 10. Or a table of order spectra as `OrderPSD` returns it,
        for bearings those of the envelope.
    parts : part, or sequence of parts
        `Bearing`, `Gear` and so on, or mappings of fault names to orders.
    harmonics : int
        Number of lines of each fault.
    slip : float
        Largest deviation of rolling elements from the predicted orders, as a fraction.
    false_alarm : float
        Probability that a fault is named in a row that contains only background. At
        1, the fault with the highest score is always named, and no threshold applies.
    channels : sequence of str, optional
        Channels, in this order. Default: all.
    healthy : list of Recording, or table, optional
        The same machine without faults, measured in the same way. Healthy machines have lines
        too: a fault is then named only if it is 3 dB above its highest healthy score.

    Returns
    -------
    DataFrame
        One row for each recording and channel. Columns:

        - "recording" (number in X), "channel",
        - "named": name of the fault, or "none",
        - the name of each fault: its score [dB], the mean level of its lines above the local
          background, minus that of background alone (1 to 3 dB, because the best slip is chosen),
        - "p(<fault>)": probability of a score at least as high in background alone, not
          smaller than 1/2001,
        - "slip": deviation of the lines from their predicted orders, of the fault named or, if
          there is none, of the one with the highest score,
        - "calibrated": whether `healthy` was given,
        - "explanation": a sentence.

    Raises
    ------
    TypeError, ValueError
        If an input is invalid, a recording is too short, its sampling rate is too low for the
        lines or differs from that of `healthy`; the message gives the recording.

    Notes
    -----
    Without `healthy`, a fault must have a score of 3 dB. This number is from the faults of the CWRU
    drive end and from the MFPT recordings, where healthy bearings score at most 0.7 dB and damaged
    ones at least 7.5 dB; a machine with lines of its own near the predicted orders needs `healthy`.
    The p-value only excludes background: it says nothing about other sources of lines.

    Rolling elements are not synchronous with the shaft, so whole orders count as background for
    their lines (a loose part or a blade has lines there) unless a line is predicted there. The
    second highest line of such a fault must be within 12 dB of the highest: impacts have harmonics,
    while a noise modulated by another shaft or by the mains has a single line. In the recordings
    of the drive end and of MFPT it is within 8.2 dB.

    An order that modulates another fault of the machine (the cage FTF modulates the lines of a
    ball, the shaft those of the inner ring) is named only if no other fault is, since a damaged
    ball shows it too.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import Recording, find_faults
    >>> rng, fs = np.random.default_rng(0), 10_000
    >>> struck = np.zeros(8 * fs)
    >>> struck[(np.arange(0, 8, 1 / (30 * 5.43)) * fs).astype(int)] = 1.0
    >>> ring = np.exp(-np.arange(60) / 10) * np.sin(0.6 * np.pi * np.arange(60))
    >>> signal = np.convolve(struck, ring)[: 8 * fs] + 0.3 * rng.standard_normal(8 * fs)
    >>> run = Recording({"vibration": signal}, fs, velocity=2 * np.pi * 30)
    >>> found = find_faults([run], {"BPFI": 5.415, "BPFO": 3.585})
    >>> found["named"].tolist()
    ['BPFI']
    """
    check_count(harmonics, "harmonics", at_most=100)
    check_number(false_alarm, "false_alarm", above=0, at_most=1)
    series = fault_series(parts, harmonics)
    least = len(series) / (1 + SETTINGS.draws)
    if false_alarm < least:
        raise ValueError(
            f"false_alarm = {false_alarm:g} is below {least:.2g}, the smallest that "
            f"{SETTINGS.draws} simulated backgrounds resolve for {len(series)} faults. "
            f"Raise it, or leave parts out."
        )
    measure = partial(
        _measured, parts=parts, harmonics=harmonics, slip=slip, channels=channels, series=series
    )
    baseline = None
    if healthy is not None:
        if are_recordings(healthy):
            check_rates(X, common_rates(healthy))
        with located("healthy"):
            baseline = _scores(measure(healthy), series).groupby(level="channel").max()
    rows = [_row(found, series, false_alarm, baseline) for found in measure(X)]
    return pd.DataFrame(rows)


class _Measured:
    """Lines of one recording and channel."""

    def __init__(
        self, recording: int, channel: str, psd: Any, lines: LineLevels, series: Any
    ) -> None:
        self.recording, self.channel = recording, channel
        levels, slips, heights = lines.measure(psd)
        excess, p = lines.compare(psd, levels)
        self.scores, self.p, self.slips = excess[0], p[0], slips[0]
        self.heights = [each[0] for each in heights]
        self.sidebands = [
            lines.sidebands(psd, fault, slip) for fault, slip in zip(series, slips[0], strict=True)
        ]


def _measured(
    X: Any, *, parts: Any, harmonics: int, slip: float, channels: Any, series: Any
) -> list[_Measured]:
    """Measure each recording and channel of recordings or of a table."""
    if column_names(X) is not None:
        return _of_table(X, 0, series, slip, channels)
    top = highest_order(parts, harmonics, slip)
    found = []
    for index, recording in enumerate(as_recordings(X, "find_faults")):
        with located(partial(described, recording, index)):
            revolutions = _segment(recording, top, channels)
            recipe = bearing_recipe(
                parts, harmonics=harmonics, slip=slip, revolutions=revolutions, channels=channels
            )
            table = recipe[:-1].fit_transform([recording])
            found += _of_table(table, index, series, slip, channels)
    return found


def _segment(recording: Recording, top: float, channels: Any) -> int:
    """Return the length of the segments of a recording [revolutions]."""
    paths = recording.paths()
    longest = max((path.length for path in paths), default=0.0) / (2 * np.pi)
    if longest < _SHORTEST:
        raise ValueError(
            f"its longest stroke has {longest:.3g} revolutions; {_SHORTEST} are needed to separate "
            f"the lines of the faults. Give a longer recording."
        )
    fastest = np.abs(recording.velocity).max() / (2 * np.pi)
    for name in recording.channels if channels is None else channels:
        check_channel_names(recording.channels, [name])
        width = 7 / 16 * recording.fs[name]
        if top * fastest > width:
            raise ValueError(
                f"the lines of the faults reach order {top:.4g}, {top * fastest:.4g} Hz at its "
                f"highest speed, but the envelope of channel {name!r}, sampled at "
                f"{recording.fs[name]:g} Hz, ends at {width:.4g} Hz. Lower harmonics, or leave out "
                f"the parts with the highest orders."
            )
    return min(_LONGEST, int(longest))


def _of_table(
    table: Any, first: int, series: tuple[FaultSeries, ...], slip: float, channels: Any
) -> list[_Measured]:
    """Measure each row and channel of a table."""
    # FaultLines checks the table: its axis, its values, its channels.
    checked = FaultLines(
        {fault.name: fault.orders[0] for fault in series}, harmonics=1, channels=channels
    ).fit(table)
    psd = np.asarray(table, np.float64)
    blocks = {
        block.channel: block for block in parse_order_columns(column_names(table) or ()) or ()
    }
    found = []
    for row in range(len(psd)):
        for channel in checked.channels_:
            block = blocks[channel]
            lines = _line_levels(tuple(block.orders.tolist()), series, slip)
            spectrum = psd[row : row + 1, block.columns]
            found.append(_Measured(first + row, channel, spectrum, lines, series))
    return found


@lru_cache(maxsize=32)
def _line_levels(
    orders: tuple[float, ...], series: tuple[FaultSeries, ...], slip: float
) -> LineLevels:
    """Return the measurement for an order axis, with the backgrounds it has simulated."""
    return LineLevels(np.array(orders), series, slip, _BACKGROUND, without_shaft=True)


def _scores(found: list[_Measured], series: Sequence[FaultSeries]) -> pd.DataFrame:
    index = pd.Index([each.channel for each in found], name="channel")
    return pd.DataFrame([each.scores for each in found], index, [fault.name for fault in series])


def _row(
    found: _Measured,
    series: Sequence[FaultSeries],
    false_alarm: float,
    baseline: pd.DataFrame | None,
) -> dict[str, Any]:
    """Return the row of the result of one recording and channel."""
    limits = np.full(len(series), EFFECT)
    if baseline is not None:
        if found.channel not in baseline.index:
            raise ValueError(
                f"healthy has no channel {found.channel!r}; its channels are "
                f"{list(baseline.index)}."
            )
        limits = EFFECT + np.maximum(baseline.loc[found.channel].to_numpy(), 0.0)
    passed, single = np.ones(len(series), bool), _single_lines(found, series)
    if false_alarm < 1:
        passed = (found.p <= false_alarm / len(series)) & (found.scores >= limits)
        passed &= ~single
    own = passed & ~np.array([any(_modulates(one, other) for other in series) for one in series])
    candidates = own if own.any() else passed
    best = int(np.where(candidates, found.scores, -np.inf).argmax())
    if not candidates.any():
        best = int(found.scores.argmax())
    row: dict[str, Any] = {
        "recording": found.recording,
        "channel": found.channel,
        "named": series[best].name if candidates.any() else NONE,
    }
    row |= {fault.name: found.scores[k] for k, fault in enumerate(series)}
    row |= {f"p({fault.name})": found.p[k] for k, fault in enumerate(series)}
    row |= {"slip": found.slips[best], "calibrated": baseline is not None}
    text = _sentence(found, series[best], best)
    if candidates.any():
        kind = series[best].kind
        text += "" if kind in ("", "given") else f": {kind}"
        others = [other.name for other in series if _modulates(series[best], other)]
        text += f", or the modulation of {' or '.join(others)}" if others else ""
    elif found.scores[best] < limits[best]:
        text = f"no fault: {text}; its score of {found.scores[best]:.1f} dB, the highest, is below "
        text += f"{limits[best]:.1f} dB"
    elif single[best]:
        text = f"no fault: {text}; a single line is a modulation, impacts have harmonics"
    else:
        text = f"no fault: {text}, which background alone may reach (p = {found.p[best]:.2g})"
    return row | {"explanation": text}


def _single_lines(found: _Measured, series: Sequence[FaultSeries]) -> NDArray[np.bool_]:
    """Return which faults of rolling elements have one line only, as a modulation has.

    Impacts have harmonics of similar height.
    """
    heights = [np.sort(lines)[::-1] for lines in found.heights]
    return np.array(
        [
            fault.slips and len(lines) > 1 and lines[0] - lines[1] > SINGLE
            for fault, lines in zip(series, heights, strict=True)
        ]
    )


def _modulates(fault: FaultSeries, other: FaultSeries) -> bool:
    """Return whether one fault has the order of a modulation of another one."""
    return any(np.isclose(fault.orders[0], order) for _, order in other.sidebands)


def _sentence(found: _Measured, fault: FaultSeries, k: int) -> str:
    """Describe the lines of a fault."""
    heights = [f"{height:.0f}" for height in found.heights[k]]
    text = f"{fault.name} is {heights[0]}"
    if len(heights) > 1:
        count = len(heights) - 1
        number = _FEW[count] if count < len(_FEW) else str(count)
        text = f"{fault.name} and {number} harmonic{'s' * (count > 1)} are "
        text += f"{', '.join(heights[:-1])} and {heights[-1]}"
    text += " dB above the local background"
    sides = [name for name, level in found.sidebands[k].items() if level >= _SIDEBANDS]
    if sides:
        text += f", with {' and '.join(sides)} sidebands"
    return text
