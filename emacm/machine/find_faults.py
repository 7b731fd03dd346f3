"""Faults named from the geometry of a machine, without training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from emacm._checks import check_number
from emacm.machine.fault_lines import FaultLines
from emacm.machine.fault_orders import Parts, damage_series
from emacm.machine.fault_spectra import (
    Fault,
    HealthyScores,
    Measured,
    healthy_scores,
    measured_spectra,
)
from emacm.machine.plain_lines import missing_condition, rises
from emacm.recordings.inputs import check_channel_names, entry_name

NONE, NOT_ASSESSED = "none", "not assessed"


@dataclass(frozen=True)
class NamingSettings:
    """When a fault is named or suspected.

    Chosen by ``python benchmarks/bearings.py`` on the drive end of CWRU and on MFPT; that `named`
    and `depth` also hold for a further fault follows two false balls of the drive end.

    Attributes
    ----------
    suspected : float
        Score from which on a fault is suspected; with healthy recordings, the distance from their
        highest score from which on it is named [dB].
    named : float
        Score from which on a fault is named without healthy recordings [dB].
    depth : float
        Depth of modulation from which on it is named without healthy recordings: amplitude of the
        lines over the mean of the envelope.
    periodic : float
        Score in the envelope of a band, without prewhitening, from which on impacts that repeat
        exactly are named [dB].
    """

    suspected: float = 3.0
    named: float = 6.0
    depth: float = 0.04
    periodic: float = 12.0


class FaultTable(pd.DataFrame):
    """Result of `find_faults`: a DataFrame; notebooks show what was named, with its sentences.

    Whatever is selected or computed from it is a plain DataFrame.
    """

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
    settings: NamingSettings = NamingSettings(),
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
        parts have too, of mesh, shafts and supply, are only compared with `healthy`.
    harmonics : int
        Number of lines of each fault.
    slip : float
        Largest deviation of rolling elements from the predicted orders, as a fraction.
    false_alarm : float
        Probability that a fault is named in a row of background; at 1, the highest score is named.
    channels : sequence of str, optional
        Channels, in this order. Default: all.
    healthy : list of Recording, or table, or result of `healthy_scores`, optional
        The same machine without faults, in the form of X. Healthy machines have lines too: a
        fault is then named if it is 3 dB above its highest healthy score, whatever it is. A fault
        of a gear needs them. "load" of the recordings' `meta` is used where it is stated.
    settings : NamingSettings
        Limits from which on a fault is suspected and named.

    Returns
    -------
    DataFrame
        One row for each recording and channel; notebooks show "named", "suspected" and
        "explanation" as a table (`FaultTable`). Columns:

        - "recording" (number in X), "channel",
        - "named": name of the fault, or several joined by " + ", the strongest first; "none"; or
          "not assessed", with the reason in "explanation"; with `healthy` also "pinion or wheel",
          "1x" and "2x",
        - "suspected": in the same form, lines that healthy machines may also have at this level,
          or that another speed or geometry would explain; "none" if a fault is named,
        - the name of each fault: its score [dB], the mean level of its lines above the local
          background, minus that of background alone (1 to 3 dB, because the best slip is chosen);
          NaN if the spectrum, or that of `healthy`, does not resolve its lowest line: it is then
          not named,
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
    `healthy` it is neither named nor suspected. With it, where the envelope shows no fault:

    - The sidebands of the mesh at the turns of pinion and wheel, in the order spectrum of the
      signal itself, are compared with at least three healthy recordings of the nearest speed and
      load. Sidebands beside one harmonic of the mesh that are 3 dB above the highest of these, in
      level and relative to the median of the spectrum, name the gear; "pinion or wheel" if those of
      the other one rose too, within 6 dB of it. The mesh itself may have risen alike: another load
      or assembly has the same effect. On a gear rig (32:80, one assembly each), 5 of 5 recordings
      with a broken tooth are found and 0 of 5 healthy ones, each left out of its own baseline.
    - 1x, 2x and orders of a mapping are named if their lines in that spectrum are 6 dB above. The
      orders 1 and 2 of a mapping are the shaft itself, and named by nothing else.
    - From two thirds of these limits on, they are suspected. If no healthy recording has the speed
      (within 5 %) and, where stated, the load (between theirs, or within a third of their range or
      10 % of the highest), these, gears in the envelope and bearings below 6 dB are only suspected.

    Prewhitening removes impacts that repeat exactly, as in simulations without slip or of a tooth,
    and those that excite only a narrow resonance are weak in the whole band. Where nothing else is
    named, the envelopes of octaves (up to 15/32 of the sampling rate, as wide as the lines at
    least) are searched without it: a fault is named from a score of 12 dB on, if all of its lines
    are at least 10 dB high and no other fault is within 3 dB; without `healthy`, within 0.3 % of
    multiples of 50 or 60 Hz, it is suspected. Weaker impacts of this kind are not seen.

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
    the speed that would fit. This is found by the harmonics of the shaft (of recordings) or by the
    lines of a fault:

    - The first six harmonics of the shaft, if three of them are 9 dB high and their mean height is
      10 dB or more and 6 dB more than at the stated speed, show an error up to 10 %. Up to `slip`
      the speed is corrected, from there on the recording is not assessed. Another shaft of nearly
      the same speed, or harmonics of the mains, may be taken for the shaft: raise `slip` then.
      Healthy recordings at a wrong speed are refused.
    - Lines within 10 % of the predicted orders, but outside of `slip`, would be named, and are
      higher by 3 dB than those within (by 6 dB if these would be named without `healthy`). Lines
      that healthy recordings have there are no evidence of a wrong speed.

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
    check_number(false_alarm, "false_alarm", above=0, at_most=1)
    series = damage_series(parts, harmonics)
    if not series:
        raise ValueError(
            "the parts have no lines of damage. Add a Bearing, BallScrew, Gear or PlanetaryGear, "
            "or a mapping of names to orders."
        )
    if false_alarm < len(series) / 2001:  # p-values are at least 1/2001
        raise ValueError(
            f"false_alarm = {false_alarm:g} is below {len(series) / 2001:.2g}, the least that 2000 "
            f"simulated backgrounds resolve for {len(series)} faults. Raise it, or leave parts out."
        )
    options: dict[str, Any] = {"harmonics": harmonics, "slip": slip, "channels": channels}
    by_channel = healthy
    if healthy is not None and not isinstance(healthy, Mapping):
        by_channel = healthy_scores(healthy, parts, **options)
    rows = []
    for measured in measured_spectra(X, FaultLines(parts, **options)):
        usual = None
        if by_channel is not None:
            check_channel_names(list(by_channel), [measured.channel], "healthy")
            usual = by_channel[measured.channel]
            _check_rate(X, measured, usual.fs)
        case = _Case(measured, usual, false_alarm, settings)
        # The first rule that answers decides.
        rules = (_defect, _highest_score, _wrong_speed, _named, _periodic, _risen, _suspected)
        finding = next(filter(None, (rule(case) for rule in rules)))
        row = {"recording": measured.number, "channel": measured.channel}
        row |= {"named": finding.named, "suspected": finding.suspected}
        row |= {fault.name: fault.score for fault in case.faults}
        row |= {f"p({fault.name})": fault.p for fault in case.faults}
        row |= {"slip": finding.fault.slip, "calibrated": healthy is not None}
        rows.append(row | {"explanation": finding.text + measured.correction})
    names = [fault.name for fault in series]
    head = ["recording", "channel", "named", "suspected", *names, *(f"p({n})" for n in names)]
    return FaultTable(rows, columns=[*head, "slip", "calibrated", "explanation"])


class _Finding(NamedTuple):
    """What is named and suspected in a spectrum, the fault that is explained, and a sentence."""

    named: str
    suspected: str
    fault: Fault
    text: str


@dataclass(frozen=True)
class _Case:
    """What is measured of one channel, and what it is compared with.

    Attributes
    ----------
    measured : Measured
        Spectra, speed and defects.
    healthy : HealthyScores or None
        Scores of healthy recordings.
    false_alarm : float
        Probability that a fault is named in background alone.
    settings : NamingSettings
        Limits of scores.
    """

    measured: Measured
    healthy: HealthyScores | None
    false_alarm: float
    settings: NamingSettings

    @cached_property
    def faults(self) -> list[Fault]:
        """All faults."""
        return _compared(self.measured.spectrum.faults(), self.healthy and self.healthy.within_slip)

    @cached_property
    def raised(self) -> list[Fault]:
        """Those that healthy recordings do not have, or all of them."""
        least = -np.inf if self.healthy is None else self.settings.suspected
        return [f for f in self.faults if f.excess >= least and not f.is_of_shaft]

    @cached_property
    def best(self) -> Fault:
        """The only one that may be named first."""
        faults = [fault for fault in self.faults if not fault.is_of_shaft] or self.faults
        possible = [fault for fault in faults if not fault.modulated(self.raised)] or faults
        if self.healthy is None:  # shafts have lines in any case
            possible = [fault for fault in possible if fault.series.slips] or possible
        return max(possible, key=lambda fault: fault.excess)

    @cached_property
    def at_other_speed(self) -> Fault | None:
        """The strongest fault that would be named with another speed."""
        faults = self.measured.spectrum.faults_at_other_speeds()
        likely = [
            fault
            for fault in _compared(faults, self.healthy and self.healthy.other_speeds)
            if fault.series.slips
            and not fault.modulated(self.faults)
            and not self.below_limits(fault)
        ]
        return max(likely, key=lambda fault: fault.excess, default=None)

    @cached_property
    def missing(self) -> str:
        """Which condition healthy recordings do not have, or "".

        At other speeds, lines of shafts meet the resonances, and they grow with the load.
        """
        plain = self.measured.plain
        if plain is None or self.healthy is None or not self.healthy.plain:
            return ""
        return missing_condition(plain, self.healthy.plain)

    def below_limits(self, fault: Fault) -> str:
        """Return which limit a fault does not reach, or ""."""
        if fault.is_of_shaft:
            return "; in the envelope, the shaft itself is no fault"
        calibrated = self.healthy is not None
        limit = self.settings.suspected if calibrated else self.settings.named
        if not self.is_significant(fault):
            digits = 0 if fault.p >= 0.1 else 1
            return f", which noise alone reaches in {100 * fault.p:.{digits}f} % of cases"
        if fault.excess < limit:
            remedy = "" if calibrated else "; healthy recordings of the machine would decide"
            limit += fault.healthy
            return f"; its score of {fault.score:.1f} dB is below {limit:.1f} dB{remedy}"
        if fault.is_single:
            return "; a single line is a modulation, impacts have harmonics"
        if not calibrated and not fault.series.slips:
            return "; shafts of healthy machines have such lines too"
        if not calibrated and fault.depth < self.settings.depth:
            return (
                f"; they modulate the envelope by {100 * fault.depth:.1f} %, as those of healthy "
                f"machines do, which would decide"
            )
        return ""

    def rejection(self, fault: Fault) -> str:
        """Return why a fault is not named, or ""."""
        reason = self.below_limits(fault)
        if not reason and self.measured.finer[0].has_other_source(fault):
            return "; the lines between them are as high, as with impacts of another source"
        return reason

    def name_of(self, fault: Fault) -> str:
        """Return the name of a fault; of gears with the same lines, the names of all."""
        orders = fault.series.orders
        same = [f.name for f in self.faults if f.series.orders == orders and not f.is_of_shaft]
        return fault.name if fault.series.slips else " or ".join(same)

    def is_significant(self, fault: Fault) -> bool:
        """Return whether background alone hardly reaches the score of a fault."""
        return fault.p <= self.false_alarm / len(self.faults)


def _compared(faults: list[Fault], healthy: Mapping[str, float] | None) -> list[Fault]:
    """Return the faults that were measured in healthy recordings too, with the highest score."""
    if healthy is None:
        return faults
    return [f._replace(healthy=healthy[f.name]) for f in faults if f.name in healthy]


def _defect(case: _Case) -> _Finding | None:
    """Assess no channel that carries no answer."""
    if not case.measured.defect:
        return None
    return _Finding(NOT_ASSESSED, NONE, case.best, f"not assessed: {case.measured.defect}")


def _highest_score(case: _Case) -> _Finding | None:
    """Without a threshold, the fault with the highest score is named."""
    named = _Finding(case.best.name, NONE, case.best, _sentence(case.best, case.faults))
    return named if case.false_alarm == 1 else None


def _wrong_speed(case: _Case) -> _Finding | None:
    """Assess no channel whose lines fit another speed."""
    measured, best, fault = case.measured, case.best, case.at_other_speed
    if not measured.is_shifted:
        if fault is None or measured.finer[0].has_other_source(fault):
            return None
        is_clear = best.excess >= case.settings.named and not case.below_limits(best)
        if fault.excess < best.excess + (6.0 if is_clear else 3.0):
            return None
    text = measured.speed_text(None if measured.is_shifted else fault)
    suspected = NONE if fault is None else fault.name
    return _Finding(NOT_ASSESSED, suspected, fault or best, f"not assessed: {text}")


def _named(case: _Case) -> _Finding | None:
    """Name the best fault, and further ones by lines that it does not explain."""
    if case.rejection(case.best):
        return None
    named = [case.best]
    while fault := _further_fault(case, [fault.name for fault in named]):
        named.append(fault)
    text = "; ".join(_sentence(fault, case.faults) for fault in named)
    doubt = "" if named[0].series.slips and named[0].score >= case.settings.named else case.missing
    return _named_unless(doubt, " + ".join(map(case.name_of, named)), case.best, text)


def _further_fault(case: _Case, named: Sequence[str]) -> Fault | None:
    """Return the strongest further fault; it must reach the limits without healthy recordings."""
    possible = [f.name for f in case.raised if case.healthy is not None or f.series.slips]
    finest = case.measured.finer[0].lines
    for spectrum in case.measured.finer:
        likely = [
            fault
            for fault in spectrum.unexplained(named)
            if fault.name in possible
            # What only the finest spectrum tells from harmonics of the shaft is named in it alone.
            and spectrum.lines.separates(fault.series) == finest.separates(fault.series)
            and case.is_significant(fault)
            and fault.score >= case.settings.named
            and not fault.depth < case.settings.depth  # it is NaN in a table
        ]
        if likely:
            return max(likely, key=lambda fault: fault.score)
    return None


def _periodic(case: _Case) -> _Finding | None:
    """Name a fault by the envelope of an octave without prewhitening.

    It has impacts that repeat exactly, which are removed as a tone is, and those that excite only
    a narrow resonance. Impacts are short: all of their lines are high. In the recordings of the
    drive end and of MFPT of which nothing is named, a wrong fault has at most 10.6 dB.
    """
    usual = case.healthy and case.healthy.in_bands
    found = [
        (fault, fine, faults, band)
        for band, coarse, fine in case.measured.bands()
        for faults in [_compared(coarse.faults(), usual)]
        for fault in faults
        if (fault.series.slips or case.healthy is not None) and not fault.is_of_shaft
    ]
    if not found:
        return None
    best, fine, faults, (low, high) = max(found, key=lambda each: each[0].excess)
    same = best.series.orders
    others = [fault.excess for fault, *_ in found if fault.series.orders != same]
    if (
        best.score < max(case.settings.periodic, case.settings.named)
        or best.excess < max([case.settings.suspected, *(other + 3.0 for other in others)])
        or min(best.heights) < 10.0
        or best.depth < case.settings.depth
        or not case.is_significant(best)
        or best.modulated(faults)
        or fine.has_other_source(best)
    ):
        return None
    text = f"{_sentence(best, case.faults)}, in {low:.0f} to {high:.0f} Hz without prewhitening"
    doubt = case.missing
    if best.series.slips:  # healthy recordings have the lines of the mains too
        doubt = case.measured.of_mains(best) if case.healthy is None else ""
    return _named_unless(doubt, case.name_of(best), best, text)


def _named_unless(doubt: str, found: str, fault: Fault, text: str) -> _Finding:
    """Name a fault, or suspect it if there is a doubt."""
    if not doubt:
        return _Finding(found, NONE, fault, text)
    return _Finding(NONE, found, fault, f"{found} is suspected: {text}; {doubt}")


def _risen(case: _Case, share: float = 1.0) -> _Finding | None:
    """Name gears by the sidebands of their mesh, or else orders, that rose above healthy ones.

    With a smaller share of the limits, they are suspected.

    Sidebands of noise alone are 1 to 3 dB high, and its highest line within a slip is 6 to 7 dB.
    """
    plain = case.measured.plain
    if plain is None or case.healthy is None or not case.healthy.plain:
        return None
    table = rises(plain, case.healthy.plain)
    is_gear, settings = table["mesh"].notna(), case.settings
    least = share * np.where(is_gear, settings.suspected, settings.named)
    is_high = table["height"] >= np.where(is_gear, 5.0, 10.0)
    shown = table[is_high & (table["rise"] >= least)].sort_values("rise", ascending=False)
    if shown.empty:
        return None
    gears = shown[shown["mesh"].notna()]
    if gears.empty:
        names = [name for _, name, _ in shown.index]
        found = " + ".join(names)
        causes = {"1x": "imbalance or a bent shaft", "2x": "misalignment or looseness"}
        told = [
            (f"{name} is", rise, f": {causes[name]}" if name in causes else "")
            for name, rise in zip(names, shown["rise"], strict=True)
        ]
    else:
        (pair, _, harmonic), row = gears.index[0], gears.iloc[0]
        by_gear = table["rise"].loc[pair].groupby(level="name", sort=False).max()
        # The sidebands of a gear may be those of the other one, and both change with the mesh.
        names = by_gear.index[by_gear > by_gear.max() - settings.named].tolist()
        found, mesh = " or ".join(names), f" (the mesh itself: {row['mesh']:+.0f} dB)"
        told = [(f"sidebands of {found} at {harmonic}x mesh are", row["rise"], mesh)]
    nearest = "speed" if plain.load is None else "speed and load"
    text = "; ".join(
        f"{what} {rise:.2g} dB above the healthy recordings of the nearest {nearest}, in the order "
        f"spectrum{cause}"
        for what, rise, cause in told
    )
    fault = next((fault for fault in case.faults if fault.name in names), case.best)
    limit = settings.named if gears.empty else settings.suspected
    doubt = f"it is named from {limit:g} dB on" if share < 1 else ""
    return _named_unless(case.missing or doubt, found, fault, text)


def _suspected(case: _Case) -> _Finding:
    """Suspect faults by lines that healthy machines may also have, or find none."""
    likely = [
        fault
        for fault in case.raised
        if fault.score >= case.settings.suspected
        and case.is_significant(fault)
        and not fault.is_single
    ]
    if case.best in likely:  # beside it only a shaft may be more likely
        likely = [case.best, *(fault for fault in likely if not fault.series.slips)]
    shown = max(likely or [case.best], key=lambda fault: fault.score)
    reason = case.rejection(shown) if shown is case.best else case.below_limits(shown)
    causes = shown.modulated(case.faults) or [shown]
    if case.healthy is None and not all(fault.series.slips for fault in causes):
        likely = []
    if not likely and (risen := _risen(case, 2 / 3)):
        return risen
    suspected = " + ".join(fault.name for fault in causes) if likely else NONE
    text = f"{suspected} is suspected: {_sentence(shown, case.faults)}{reason}"
    if not likely:
        text = f"no fault: highest {_sentence(shown, case.faults, named=False)}{reason}"
        text += case.measured.of_no_part() if case.healthy is None else ""
    return _Finding(NONE, suspected, shown, text + _not_compared(case))


def _not_compared(case: _Case) -> str:
    """State what only a comparison with healthy recordings would show, or ""."""
    text = ""
    if case.measured.plain is not None:
        own = case.measured.plain.levels.loc[-1:-1].reset_index().set_index("name")["height"]
        for name in own.index[own >= 10.0].intersection([fault.name for fault in case.faults]):
            text += f"; in the order spectrum {name} is {own[name]:.0f} dB above the background"
            text += ", which healthy recordings would judge" if case.healthy is None else ""
    kinds = {fault.series.kind for fault in case.faults if not fault.series.slips} - {"given"}
    if case.healthy is None and kinds:
        only_bars = kinds == {"broken bar or end ring"}
        text += f"; {'a rotor' if only_bars else 'a gear'} needs healthy recordings"
    return text


def _check_rate(X: Any, measured: Measured, fs: float) -> None:
    """Raise a ValueError if the healthy recordings have another rate, or only one is a table."""
    if not np.isclose(measured.fs, fs, rtol=1e-6, equal_nan=True):  # it is NaN for a table
        raise ValueError(
            f"{entry_name(X, measured.number)}: channel {measured.channel!r} is sampled at "
            f"{measured.fs:g} Hz, but in healthy at {fs:g} Hz (nan: a table of spectra). Use "
            f"healthy recordings of the same sampling rate."
        )


def _sentence(fault: Fault, faults: Sequence[Fault], *, named: bool = True) -> str:
    """Describe the lines of a fault; if it is not named, after "highest"."""
    name, (*others, last) = fault.name, [f"{height:z.0f}" for height in fault.heights]
    kinds = {f.name: f.series.kind for f in faults if f.series.orders == fault.series.orders}
    same = [other for other in kinds if other != name]
    which = f"{name} (or {' or '.join(same)}: the same lines)" if same else name
    lines, verb = (f"{which} and its harmonics", "are") if others else (which, "is")
    beside = f", with {' and '.join(fault.sides)} sidebands" if fault.sides else ""
    heights = f"{', '.join(others)} and {last}" if others else last
    level = f"{heights} dB above the local background of the envelope spectrum{beside}"
    kind = fault.series.kind if {*kinds.values()} == {fault.series.kind} - {"given", name} else ""
    if not named:
        return f"{verb} {lines}{f' ({kind})' if kind else ''}, {level}"
    causes = [other.name for other in fault.modulated(faults)]
    cause = f", or the modulation of {' or '.join(causes)}" if causes else ""
    return f"{lines} {verb} {level}{f': {kind}' if kind else ''}{cause}"
