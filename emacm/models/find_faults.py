"""Faults named from the geometry of a machine, without training."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from emacm._checks import check_count, check_number, located
from emacm.conditions.healthy import are_recordings, check_rates, common_rates
from emacm.machine.fault_lines import SETTINGS as LINES
from emacm.machine.fault_lines import FaultLines, FaultSeries, LineLevels, fault_series
from emacm.machine.parts import Part
from emacm.models.recipes import bearing_recipe, highest_order
from emacm.orders.columns import column_names, parse_order_columns
from emacm.recordings.inputs import as_recordings, check_channel_names, described
from emacm.recordings.recording import Recording


@dataclass(frozen=True)
class NamingSettings:
    """When a fault is named: chosen by ``python benchmarks/bearings.py`` on CWRU and MFPT data.

    Attributes
    ----------
    least_score : float
        Score that a fault must have, and by which it must exceed the healthy ones [dB].
    single_line : float
        Height by which the highest line of a fault may exceed the second one [dB].
    sidebands : float
        Height of sidebands above the background from which on they are mentioned [dB].
    longest, shortest : int
        Length of a segment, and of the longest stroke of a recording at least [revolutions].
    """

    least_score: float = 3.0
    single_line: float = 12.0
    sidebands: float = 3.0
    longest: int = 25
    shortest: int = 10


SETTINGS = NamingSettings()


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
    least = len(series) / (1 + LINES.draws)
    if false_alarm < least:
        raise ValueError(
            f"false_alarm = {false_alarm:g} is below {least:.2g}, the smallest that {LINES.draws} "
            f"simulated backgrounds resolve for {len(series)} faults. Raise it, or leave parts out."
        )
    options: dict[str, Any] = {"harmonics": harmonics, "slip": slip, "channels": channels}
    highest: dict[str, list[float]] = {}  # healthy scores by channel
    if healthy is not None:
        if are_recordings(healthy):
            check_rates(X, common_rates(healthy))
        with located("healthy"):
            for _, channel, faults in _measured(healthy, parts, series, **options):
                before = highest.get(channel, [0.0] * len(faults))
                highest[channel] = [max(f.score, b) for f, b in zip(faults, before, strict=True)]
    rows = []
    for number, channel, faults in _measured(X, parts, series, **options):
        if healthy is not None:
            check_channel_names(list(highest), [channel], "healthy")
        limits = [SETTINGS.least_score + h for h in highest.get(channel, [0.0] * len(faults))]
        row = {"recording": number, "channel": channel} | _row(faults, limits, false_alarm)
        explanation = row.pop("explanation")
        rows.append(row | {"calibrated": healthy is not None, "explanation": explanation})
    return pd.DataFrame(rows)


class _Fault(NamedTuple):
    """A fault in one recording and channel: its score [dB], its slip, and heights of lines [dB]."""

    series: FaultSeries
    score: float
    p: float
    slip: float
    heights: list[float]
    sidebands: dict[str, float]

    @property
    def is_single(self) -> bool:
        """Whether a fault of rolling elements has one line only, as a modulation has.

        Impacts have harmonics of similar height.
        """
        *_, second, highest = [-np.inf, *sorted(self.heights)]
        several = self.series.slips and len(self.heights) > 1
        return several and highest - second > SETTINGS.single_line

    def modulated(self, faults: Sequence[_Fault]) -> list[str]:
        """Return the names of the faults that are modulated at the order of this one."""
        order, series = self.series.orders[0], [fault.series for fault in faults]
        return [s.name for s in series if any(np.isclose(order, o) for _, o in s.sidebands)]


def _measured(
    X: Any, parts: Any, series: tuple[FaultSeries, ...], **options: Any
) -> Iterator[tuple[int, str, list[_Fault]]]:
    """Measure the faults of each recording and channel of recordings or of a table."""
    slip, channels = options["slip"], options["channels"]
    if column_names(X) is not None:
        yield from _of_table(X, 0, series, slip, channels)
        return
    top = highest_order(parts, options["harmonics"], slip)
    for index, recording in enumerate(as_recordings(X, "find_faults")):
        with located(partial(described, recording, index)):
            revolutions = _segment(recording, top, channels)
            recipe = bearing_recipe(parts, revolutions=revolutions, **options)
            spectra = recipe[:-1].fit_transform([recording])
            yield from _of_table(spectra, index, series, slip, channels)


def _segment(recording: Recording, top: float, channels: Any) -> int:
    """Return the length of the segments of a recording [revolutions]."""
    longest = max((path.length for path in recording.paths()), default=0.0) / (2 * np.pi)
    if longest < SETTINGS.shortest:
        raise ValueError(
            f"its longest stroke has {longest:.3g} revolutions; {SETTINGS.shortest} are needed to "
            f"separate the lines of the faults. Give a longer recording."
        )
    fastest = np.abs(recording.velocity).max() / (2 * np.pi)
    for name in recording.channels if channels is None else channels:
        check_channel_names(recording.channels, [name])
        width = 7 / 16 * recording.fs[name]  # of the envelope of the whole band
        if top * fastest > width:
            raise ValueError(
                f"the lines of the faults reach order {top:.4g}, {top * fastest:.4g} Hz at its "
                f"highest speed, but the envelope of channel {name!r}, sampled at "
                f"{recording.fs[name]:g} Hz, ends at {width:.4g} Hz. Lower harmonics, or leave out "
                f"the parts with the highest orders."
            )
    return min(SETTINGS.longest, int(longest))


def _of_table(
    table: Any, first: int, series: tuple[FaultSeries, ...], slip: float, channels: Any
) -> Iterator[tuple[int, str, list[_Fault]]]:
    """Measure the faults of each row and channel of a table."""
    # FaultLines checks the table: its axis, its values, its channels.
    lowest = {fault.name: fault.orders[0] for fault in series}
    checked = FaultLines(lowest, harmonics=1, channels=channels).fit(table)
    blocks = parse_order_columns(column_names(table) or ()) or ()
    block_of = {block.channel: block for block in blocks}
    rows = np.asarray(table, np.float64)
    for number, channel in product(range(len(rows)), checked.channels_):
        block = block_of[channel]
        psd = rows[number : number + 1, block.columns]
        lines = _line_levels(tuple(block.orders.tolist()), series, slip)
        levels, slips, heights = lines.measure(psd)
        excess, p = lines.compare(psd, levels)
        of_lines = [own[0].tolist() for own in heights]
        sidebands = [lines.sidebands(psd, *own) for own in zip(series, slips[0], strict=True)]
        columns = series, excess[0], p[0], slips[0], of_lines, sidebands
        yield first + number, channel, list(map(_Fault, *columns))


@lru_cache(maxsize=32)
def _line_levels(
    orders: tuple[float, ...], series: tuple[FaultSeries, ...], slip: float
) -> LineLevels:
    """Return the measurement for an order axis, with the backgrounds it has simulated."""
    return LineLevels(np.array(orders), series, slip, LINES.background, without_shaft=True)


def _row(faults: list[_Fault], limits: list[float], false_alarm: float) -> dict[str, Any]:
    """Return the result of one recording and channel: what is named, scores, and why."""
    passed = [
        fault
        for fault, limit in zip(faults, limits, strict=True)
        if false_alarm == 1
        or (fault.p <= false_alarm / len(faults) and fault.score >= limit and not fault.is_single)
    ]
    own = [fault for fault in passed if not fault.modulated(faults)]
    named = max(own or passed, key=lambda fault: fault.score, default=None)
    best = named or max(faults, key=lambda fault: fault.score)
    text = _lines_text(best)
    if named is not None:
        others = named.modulated(faults)
        text += "" if named.series.kind in ("", "given") else f": {named.series.kind}"
        text += f", or the modulation of {' or '.join(others)}" if others else ""
    else:
        text = f"no fault: {text}{_reason(best, limits[faults.index(best)])}"
    return {
        "named": "none" if named is None else named.series.name,
        **{fault.series.name: fault.score for fault in faults},
        **{f"p({fault.series.name})": fault.p for fault in faults},
        "slip": best.slip,
        "explanation": text,
    }


def _lines_text(fault: _Fault) -> str:
    """Describe the lines of a fault."""
    name, (*others, last) = fault.series.name, [f"{height:.0f}" for height in fault.heights]
    lines = f"{name} and its harmonics are {', '.join(others)} and" if others else f"{name} is"
    sides = [name for name, level in fault.sidebands.items() if level >= SETTINGS.sidebands]
    beside = f", with {' and '.join(sides)} sidebands" if sides else ""
    return f"{lines} {last} dB above the local background{beside}"


def _reason(fault: _Fault, limit: float) -> str:
    """Return why the fault of the highest score is not named."""
    if fault.score < limit:
        return f"; its score of {fault.score:.1f} dB, the highest, is below {limit:.1f} dB"
    if fault.is_single:
        return "; a single line is a modulation, impacts have harmonics"
    return f", which background alone may reach (p = {fault.p:.2g})"
