"""Faults named from the geometry of a machine, without training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from emacm._checks import check_count, check_number, located
from emacm.conditions.healthy import are_recordings, check_rates, common_rates
from emacm.machine.fault_lines import SETTINGS as LINES
from emacm.machine.fault_orders import Parts, fault_series, only_damage
from emacm.models.fault_spectra import SETTINGS, Fault, Measured, Spectrum, measured_spectra
from emacm.recordings.inputs import check_channel_names

NONE, NOT_ASSESSED = "none", "not assessed"


class FaultTable(pd.DataFrame):
    """Result of `find_faults`: a DataFrame; notebooks show what was named, with its sentences.

    Whatever is selected or computed from it is a plain DataFrame.
    """

    @property
    def _constructor(self) -> type[pd.DataFrame]:
        return pd.DataFrame

    def _repr_html_(self) -> str:
        shown = ("recording", "channel", "named", "suspected", "explanation")
        return self[[name for name in shown if name in self]].to_html(index=False)


def find_faults(
    X: Any,
    parts: Parts,
    *,
    harmonics: int = 3,
    slip: float = 0.02,
    false_alarm: float = 0.01,
    channels: Sequence[str] | None = None,
    healthy: Any = None,
) -> FaultTable:
    """Name the fault of each recording and channel from the geometry of the machine.

    No training is needed. A fault is named if its lines are significantly above the local
    background (p-value), far enough above it, and modulate the envelope deeply enough. Lines that
    healthy machines may also have are suspected. What carries no answer is not assessed.

    Parameters
    ----------
    X : list of Recording, or table
        Vibration as measured; prewhitening, envelope, resampling and spectra are those of
        `bearing_recipe`, with segments of 25 revolutions, or of as many whole revolutions as a
        shorter recording has, at least 10. Or a table of order spectra as `OrderPSD` returns it,
        for bearings those of the envelope.
    parts : part, or sequence of parts
        `Bearing`, `Gear` and so on, or mappings of fault names to orders. Lines that undamaged
        parts have too, of the mesh, the shafts and the supply, are not looked for.
    harmonics : int
        Number of lines of each fault.
    slip : float
        Largest deviation of rolling elements from the predicted orders, as a fraction.
    false_alarm : float
        Probability that a fault is named in a row that contains only background. At
        1, the fault with the highest score is always named, and no threshold applies.
    channels : sequence of str, optional
        Channels, in this order. Default: all.
    healthy : list of Recording, or table, or result of `healthy_scores`, optional
        The same machine without faults, measured in the same way. Healthy machines have lines
        too: a fault is then named if it is 3 dB above its highest healthy score, whatever it is.

    Returns
    -------
    DataFrame
        One row for each recording and channel; notebooks show "named", "suspected" and
        "explanation" as a table (`FaultTable`). Columns:

        - "recording" (number in X), "channel",
        - "named": name of the fault, or several joined by " + ", the strongest first; "none"; or
          "not assessed", with the reason in "explanation",
        - "suspected": in the same form, lines that healthy machines may also have at this level,
          or that another speed or geometry would explain; "none" if a fault is named,
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

    See Also
    --------
    emacm.fault_orders : Orders of the faults of several parts.
    emacm.bearing_recipe : A classifier that is trained on lines.
    emacm.angle_from_vibration : The shaft angle, if it was not measured.

    Notes
    -----
    Without `healthy`, a fault is suspected from a score of 3 dB on, and named from 6 dB on, if the
    amplitude of its lines is at least 4 % of the mean of the envelope (recordings only). These
    numbers are from the drive end of CWRU and from MFPT; healthy bearings of other machines have
    reached 9.5 dB, with which `healthy` or a trend decides. The p-value only excludes background:
    it says nothing about other sources of lines.

    The lines of a fault of a gear are those of its shaft, which healthy machines have too: without
    `healthy` it is at most suspected, and beside a fault of rolling elements it is not looked for.

    If the strongest fault is rejected, no other one is named. A further fault is named by lines
    that those before it do not explain, in a spectrum of up to 100 or 50 revolutions: harmonics of
    those, and sidebands at three multiples of each order that modulates them: of their own, and of
    shaft and cage where most of these sidebands stand out by 3 dB. At least two such lines (and the
    lowest order, unless it is explained) must be 9 dB above a background of 12 spectral lines on
    either side, and their score and depth must reach the limits of a first fault without `healthy`.
    Lines that coincide name nothing: the faults of bearings with orders near whole
    numbers are often told apart incompletely.

    A channel that is constant or clipped, has drop-outs, or at most three values is not assessed.
    Nor is a recording whose speed, sampling rate or geometry is wrong; the explanation then states
    the speed that would fit. Without `healthy`, this is found by the harmonics of the shaft
    (of recordings) or by the lines of a fault:

    - The first six harmonics of the shaft, if their mean height is 10 dB or more and 6 dB more than
      at the stated speed, show an error up to 10 %. Up to `slip` the speed is corrected, from there
      on the recording is not assessed. Another shaft of nearly the same speed, or harmonics of the
      mains, may be taken for the shaft: raise `slip` then.
    - Lines within 10 % of the predicted orders, but outside of `slip`, would be named, and are
      higher by 3 dB than those within (by 6 dB if these would be named).

    Rolling elements are not synchronous with the shaft, so whole orders count as background for
    their lines (a loose part or a blade has lines there) unless a line is predicted there. The
    second highest line of such a fault must be within 12 dB of the highest, or there must be
    sidebands: impacts have harmonics, while a noise modulated by another shaft or by the mains has
    a single line. In the recordings of the drive end and of MFPT it is within 8.2 dB.

    Impacts of another source, as of a belt or a loose part, have lines at all multiples of a lower
    order. If the lines between those of a fault of rolling elements (in the spectrum of up to 100
    revolutions, without sidebands) are at least 0.9 times as high in decibels, it is suspected.

    An order that modulates another fault of the machine (the cage FTF modulates the lines of a
    ball, the shaft those of the inner ring) is not named: the other one is suspected.

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
    >>> find_faults([run], {"BPFI": 5.415, "BPFO": 3.585})["named"].tolist()
    ['BPFI']
    """
    check_count(harmonics, "harmonics", at_most=100)
    check_number(false_alarm, "false_alarm", above=0, at_most=1)
    parts = only_damage(parts)
    series = fault_series(parts, harmonics)
    if not series:
        raise ValueError(
            "the parts have no lines of damage. Add a Bearing, BallScrew, Gear or PlanetaryGear, "
            "or a mapping of names to orders."
        )
    least = len(series) / (1 + LINES.draws)
    if false_alarm < least:
        raise ValueError(
            f"false_alarm = {false_alarm:g} is below {least:.2g}, the smallest that {LINES.draws} "
            f"simulated backgrounds resolve for {len(series)} faults. Raise it, or leave parts out."
        )
    options: dict[str, Any] = {"harmonics": harmonics, "slip": slip, "channels": channels}
    highest = healthy
    if healthy is not None and not isinstance(healthy, Mapping):
        if are_recordings(healthy):
            check_rates(X, common_rates(healthy))
        highest = healthy_scores(healthy, parts, **options)
    rows = []
    for measured in measured_spectra(X, parts, series, **options):
        if highest is not None:
            check_channel_names(list(highest), [measured.channel], "healthy")
        limits = None if highest is None else highest[measured.channel]
        found = _Finding.of(measured, limits, false_alarm)
        row = {"recording": measured.number, "channel": measured.channel} | found.columns()
        text = found.text + measured.corrected()
        rows.append(row | {"calibrated": healthy is not None, "explanation": text})
    return FaultTable(rows)


def healthy_scores(
    healthy: Any,
    parts: Any,
    *,
    harmonics: int = 3,
    slip: float = 0.02,
    channels: Sequence[str] | None = None,
) -> dict[str, list[float]]:
    """Return the highest score of each fault in healthy recordings, not below 0 dB, by channel.

    `find_faults` takes the result as `healthy`, so that many recordings can be judged one by one.
    """
    parts, highest = only_damage(parts), dict[str, list[float]]()
    series = fault_series(parts, harmonics)
    options: dict[str, Any] = {"harmonics": harmonics, "slip": slip, "channels": channels}
    with located("healthy"):
        for measured in measured_spectra(healthy, parts, series, **options):
            scores = [fault.score for fault in measured.spectrum.faults()]
            before = highest.get(measured.channel, [0.0] * len(scores))
            highest[measured.channel] = list(map(max, scores, before))
    return highest


class _Finding(NamedTuple):
    """What is named and suspected in a spectrum, with the scores of all faults, and why."""

    faults: list[Fault]
    named: str
    suspected: str
    best: Fault
    text: str

    @classmethod
    def of(
        cls, measured: Measured, healthy: Sequence[float] | None, false_alarm: float
    ) -> _Finding:
        """Decide on what is measured."""
        faults, fine = measured.spectrum.faults(), measured.fine
        usual = healthy or [0.0] * len(faults)
        higher = [
            fault
            for fault, most in zip(faults, usual, strict=True)
            if not healthy or fault.score >= most + SETTINGS.suspected
        ]
        own = [fault for fault in faults if not fault.modulated(higher)] or faults
        if not healthy:  # shafts have lines in any case
            own = [fault for fault in own if fault.series.slips] or own
        best = max(own, key=lambda fault: fault.score - usual[faults.index(fault)])
        if measured.defect:
            return cls(faults, NOT_ASSESSED, NONE, best, f"not assessed: {measured.defect}")
        if false_alarm == 1:
            return cls(faults, best.series.name, NONE, best, _sentence(best, faults))
        reason = _reason(best, faults, healthy, false_alarm)
        margin = SETTINGS.suspected if reason else SETTINGS.named
        error = None if healthy else _speed_error(measured.spectrum.wide(), faults, false_alarm)
        is_higher = error is not None and error.score >= best.score + margin
        is_shifted = not healthy and abs(measured.shift) > measured.spectrum.lines.slip
        if is_shifted or (error is not None and is_higher and not fine[0].other_source(error)):
            text = f"not assessed: {_speed_text(measured, None if is_shifted else error)}"
            suspected = NONE if error is None else error.series.name
            return cls(faults, NOT_ASSESSED, suspected, error or best, text)
        reason = reason or fine[0].other_source(best)
        if not reason:
            names, text = [best.series.name], _sentence(best, faults)
            possible = [f.series.name for f in higher if healthy or f.series.slips]
            beside = possible, false_alarm, fine[0].lines
            while found := [f for s in fine if (f := s.further(names, *beside))]:
                names.append(found[0].series.name)
                text += f"; {_sentence(found[0], faults)}"
            return cls(faults, " + ".join(names), NONE, best, text)
        passed = [fault for fault in higher if not _unlikely(fault, faults, false_alarm)]
        if best in passed:  # beside it only a shaft may be more likely
            passed = [best, *(fault for fault in passed if not fault.series.slips)]
        likeliest = max(passed or [best], key=lambda fault: fault.score)
        if likeliest is not best:
            best, reason = likeliest, _reason(likeliest, faults, healthy, false_alarm)
        causes = best.modulated(faults) or [best]
        suspected = " + ".join(f.series.name for f in causes) if passed else NONE
        sentence = _sentence(best, faults)
        text = f"{'no fault' if suspected == NONE else f'{suspected} is suspected'}: {sentence}"
        return cls(faults, NONE, suspected, best, f"{text}{reason}")

    def columns(self) -> dict[str, Any]:
        """Return the columns of the row."""
        return {
            "named": self.named,
            "suspected": self.suspected,
            **{fault.series.name: fault.score for fault in self.faults},
            **{f"p({fault.series.name})": fault.p for fault in self.faults},
            "slip": self.best.slip,
        }


def _unlikely(fault: Fault, faults: Sequence[Fault], false_alarm: float) -> bool:
    """Tell whether a fault is not even suspected."""
    likely = fault.score >= SETTINGS.suspected and fault.p <= false_alarm / len(faults)
    return not likely or fault.is_single


def _reason(
    fault: Fault, faults: Sequence[Fault], healthy: Sequence[float] | None, false_alarm: float
) -> str:
    """Return why a fault is not named, or ""."""
    limit = SETTINGS.named
    if healthy is not None:
        limit = SETTINGS.suspected + healthy[faults.index(fault)]
    if fault.p > false_alarm / len(faults):
        return f", which background alone may reach (p = {fault.p:.2g})"
    if fault.score < limit:
        remedy = "" if healthy else "; healthy recordings of the machine would decide"
        return f"; its score of {fault.score:.1f} dB is below {limit:.1f} dB{remedy}"
    if fault.is_single:
        return "; a single line is a modulation, impacts have harmonics"
    if healthy is None and not fault.series.slips:
        return "; shafts of healthy machines have such lines too: healthy recordings would decide"
    if healthy is None and fault.depth < SETTINGS.depth:
        return (
            f"; they modulate the envelope by {100 * fault.depth:.1f} %, as those of healthy "
            f"machines do, which would decide"
        )
    return ""


def _speed_error(
    wide: Spectrum | None, faults: Sequence[Fault], false_alarm: float
) -> Fault | None:
    """Return the strongest fault that would be named with another speed."""
    found = [
        fault
        for fault in (wide.faults() if wide is not None else ())
        if fault.series.slips
        and not fault.modulated(faults)
        and not _reason(fault, faults, None, false_alarm)
    ]
    return max(found, key=lambda fault: fault.score, default=None)


def _speed_text(measured: Measured, fault: Fault | None) -> str:
    """State the speed or geometry that fits the lines of a fault, or else those of the shaft."""
    factor = 1 + (measured.shift if fault is None else fault.slip)
    text = f"harmonics of the shaft are at {factor:.3f} and multiples of it"
    if fault is not None:
        order, side = fault.series.orders[0], "above" if fault.slip > 0 else "below"
        text = (
            f"lines at {order * factor:.3f} and multiples of it are like those of "
            f"{fault.series.name}, but {100 * abs(fault.slip):.1f} % {side} {order:.3f}"
        )
    if np.isnan(measured.rpm):
        return f"{text}. Correct the speed or the geometry, or raise slip."
    question = f"is the speed {measured.rpm * factor:.0f} rpm, or the sampling rate wrong?"
    return f"{text}: {question} Otherwise correct the geometry, or raise slip."


def _sentence(fault: Fault, faults: Sequence[Fault]) -> str:
    """Describe the lines of a fault."""
    name, (*others, last) = fault.series.name, [f"{height:z.0f}" for height in fault.heights]
    same = [f.series.name for f in faults if f.series.orders == fault.series.orders]
    same = [other for other in same if other != name]
    which = f"{name} (or {' or '.join(same)}: the same lines)" if same else name
    lines = f"{which} and its harmonics are {', '.join(others)} and" if others else f"{which} is"
    beside = f", with {' and '.join(fault.sides)} sidebands" if fault.sides else ""
    kind = "" if fault.series.kind in ("", "given", name) else f": {fault.series.kind}"
    causes = [other.series.name for other in fault.modulated(faults)]
    cause = f", or the modulation of {' or '.join(causes)}" if causes else ""
    return f"{lines} {last} dB above the local background{beside}{kind}{cause}"
