"""Shaft angle from a tachometer (keyphasor): pulses, their repair, the angle between them [rad]."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy  # scipy.signal is imported when it is used
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PchipInterpolator
from scipy.ndimage import minimum_filter1d

from emacm._checks import check_choice, check_count, check_number, check_signal, located
from emacm._statements import EmacmWarning, Statement
from emacm.shaft.mark_numbers import number_pulses

Angle = NDArray[np.float64]


def pulse_times(
    tacho: ArrayLike,
    fs: float,
    *,
    threshold: float | None = None,
    hysteresis: float | None = None,
    edge: str = "rising",
) -> NDArray[np.float64]:
    """Find the pulses of a raw tacho channel, by a Schmitt trigger.

    A pulse counts once the signal has gone from below ``threshold - hysteresis / 2`` to above
    ``threshold + hysteresis / 2``; its time is the last crossing of the threshold in between,
    by linear interpolation. The error is far less than a sample if slopes are resolved, up to half
    a sample for square pulses: ``speed / (2 fs)`` rad of shaft angle.

    Parameters
    ----------
    tacho : array_like of shape (n_times,)
        Raw tacho channel, in any unit.
    fs : float
        Sampling rate [Hz].
    threshold : float, optional
        Level whose crossing is a pulse. Default: halfway between the 0.1 and 99.9 % percentiles; if
        the level drifts, of each part of the signal.
    hysteresis : float, optional
        Width of the band in which noise causes no pulses. Default: a quarter of the distance of the
        two percentiles.
    edge : {"rising", "falling"}
        Edge to use: the steeper one is more accurate.

    Returns
    -------
    ndarray of shape (n_pulses,)
        Times [s], the first sample at 0.

    Raises
    ------
    ValueError, TypeError
        If the channel is not a finite numeric signal, is flat, has no pulse, or (without
        `threshold` and `hysteresis`) has peaks so rare that its levels cannot be determined.

    Warns
    -----
    EmacmWarning
        If the level drifts, or the pulses are so short that some may lie between two samples.

    See Also
    --------
    emacm.angle_from_pulses : The shaft angle from these times.

    Examples
    --------
    >>> pulse_times([0, 0, 1, 1, 0, 0, 1, 1, 0], fs=1)
    array([1.5, 5.5])
    """
    times, statements = _stated_pulses(tacho, fs, threshold, hysteresis, edge)
    _warn(statements)
    return times


def _stated_pulses(
    tacho: ArrayLike,
    fs: float,
    threshold: float | None = None,
    hysteresis: float | None = None,
    edge: str = "rising",
) -> tuple[Angle, tuple[Statement, ...]]:
    """Return the times of pulses, and what is to be known about the signal."""
    signal = check_signal(tacho, "tacho").astype(np.float64)
    fs = check_number(fs, "fs", above=0, unit="Hz")
    check_choice(edge, "edge", ("rising", "falling"))
    statements: list[Statement] = []
    if threshold is None:
        signal, drift = _without_drift(signal)
        if drift:
            text = f"the level of the tachometer drifts by {drift:.3g} of its pulses; the drift is "
            text += "taken out, as by a high-pass"
            statements.append(Statement("drift", "", text, False, drift, 0.25))
    if threshold is None or hysteresis is None:
        # Levels by percentiles that a few spikes do not move.
        low, high = (float(level) for level in np.percentile(signal, (0.1, 99.9)))
        _check_levels(signal, low, high)
        threshold = (low + high) / 2 if threshold is None else threshold
        hysteresis = (high - low) / 4 if hysteresis is None else hysteresis
    level = check_number(threshold, "threshold")
    half = check_number(hysteresis, "hysteresis", at_least=0) / 2
    height = (signal - level) * (1.0 if edge == "rising" else -1.0)
    fired, above = _fired(height, half)
    _check_drift(signal, len(fired))
    if not len(fired):
        raise ValueError(
            f"tacho must cross {level:.6g} ± {half:.6g} by a {edge} edge, got none in values from "
            f"{signal.min():.6g} to {signal.max():.6g}. Set threshold and hysteresis, or apply a "
            f"high-pass if the level drifts."
        )
    crossing = np.flatnonzero((height[:-1] < 0) & (height[1:] >= 0))
    last = crossing[np.searchsorted(crossing, fired) - 1]
    width = (min(above, len(signal) - above) - 1) / len(fired)  # the first one may be cut
    if width <= 1:
        text = "the pulses of the tachometer last one sample or less, so that some are missed: "
        text += "sample faster, or use wider marks"
        statements.append(Statement("short pulses", "", text, True, width, 1.0))
    return (last + height[last] / (height[last] - height[last + 1])) / fs, tuple(statements)


def _fired(height: Angle, half: float) -> tuple[NDArray[np.intp], int]:
    """Return the samples at which a Schmitt trigger fires, and how many are above."""
    decided = np.flatnonzero((height >= half) | (height <= -half))
    above = height[decided] >= half
    return decided[1:][above[1:] & ~above[:-1]], int(np.count_nonzero(height > 0))


def _without_drift(signal: Angle) -> tuple[Angle, float]:
    """Subtract the middle of the levels if it drifts; return by how many heights of a pulse.

    The levels are those of parts of the signal, as many as have three pulses in each of them.
    """
    for n_parts in (n for n in (64, 32, 16, 8, 4) if n <= len(signal) // 16):
        parts = np.array_split(signal, n_parts)
        low, high = np.array([np.percentile(part, (0.1, 99.9)) for part in parts]).T
        middle, height = (low + high) / 2, high - low
        trigger = zip(parts, middle, height, strict=True)
        if height.min() > 0 and all(len(_fired(x - m, h / 4)[0]) > 2 for x, m, h in trigger):
            drift = float(np.ptp(middle) / np.median(height))
            centres = (np.arange(n_parts) + 0.5) * len(signal) / n_parts
            course = np.interp(np.arange(len(signal)), centres, middle)
            return (signal - course, drift) if drift > 0.25 else (signal, 0.0)  # of the hysteresis
    return signal, 0.0


def _check_drift(signal: Angle, n_pulses: int) -> None:
    """Refuse a level that drifts or jumps by more than the pulses, of which many cross none.

    Then there are more peaks than pulses, all equally high and far above the noise.
    """
    span = np.ptp(signal)
    noise = np.median(np.abs(np.diff(signal, 2)))
    _, found = scipy.signal.find_peaks(signal, prominence=max(0.04 * span, 8 * noise))
    n_high = np.count_nonzero(found["prominences"] > span / 2)
    is_interference = n_pulses >= 5 and 0.8 * n_pulses < n_high < 1.25 * n_pulses
    if len(found["prominences"]) <= 3 + 1.5 * n_pulses or is_interference:
        return
    low, height, high = np.quantile(found["prominences"], (0.25, 0.5, 0.75))
    if high < 1.6 * low:
        raise ValueError(
            f"tacho must have two levels, got a level that drifts or jumps by {span - height:.4g} "
            f"where the pulses are {height:.4g} high (or pulses with an interference of that "
            f"height). Apply a high-pass (or low-pass), as scipy.signal.butter, or cut the "
            f"recording at the jump."
        )


@dataclass(frozen=True, eq=False)
class TachoAngle:
    """Shaft angle from tacho pulses, and the repairs of the pulses.

    Attributes
    ----------
    angle : ndarray of shape (n_times,)
        Angle [rad], 0 at the first pulse.
    missing : ndarray of shape (n_missing,)
        Times [s] at which a missing pulse was inserted.
    double : ndarray of shape (n_double,)
        Times [s] of the double pulses that were removed.
    statements : tuple of Statement
        What is to be known: many repairs, jitter, a level that drifts, pulses that are too short,
        a speed that changes suddenly, or falls and rises again.
    """

    angle: Angle
    missing: NDArray[np.float64]
    double: NDArray[np.float64]
    statements: tuple[Statement, ...] = ()


def angle_from_pulses(
    times: ArrayLike, fs: float, n_times: int, *, pulses_per_rev: float = 1
) -> TachoAngle:
    """Interpolate the shaft angle between tacho pulses, after repair of missing and double pulses.

    Missing and double pulses change the speed abruptly. Of all ways to number the pulses, nearly
    the one is taken with the least sum of changes of the logarithm of the speed, of 0.3 for each
    gap and of 1 for each double pulse; a speed that goes on rising or falling as before is no
    change, so a start from rest is not treated as a fault. A speed that changes by more than half
    within an interval of pulses, as at a sudden stop, looks like a missing or double pulse, and one
    that is misidentified shifts all later angles by ``2 pi / pulses_per_rev``; it is stated where
    another number of pulses is nearly as likely.

    The marks of a revolution may be uneven: a tape with a butt joint, a wheel with a gap whose real
    or nominal number of marks is given. If `pulses_per_rev` is a whole number and there are two
    revolutions at least, the spacing is learned from what repeats in each revolution, and used for
    the angle. Deviations of less than 5 % are left to the speed, as are waves of up to one for ten
    marks: they may be a speed that varies within each revolution. With fewer than ten marks, such a
    speed cannot be told from uneven marks, and is taken for them above 5 %.

    Between pulses the angle is a cubic spline, its slopes limited to stay monotone [1]_. Measured
    errors at one pulse per revolution: 1e-11 rad at constant speed and at constant acceleration,
    also with a missing or double pulse (PCHIP: 0.08 rad from 2 to 20 rev/s in 1 s); with 20 % of
    speed ripple and ten pulses per cycle 4e-3 rad, or 0.03 rad if a pulse is missing. Before the
    first and after the last pulse the speed is held at its value at that pulse. The error is half
    the acceleration times the time squared: 0.6 rad on that ramp. Pulses do not indicate the
    direction: the angle always rises, so a shaft that reverses needs another sensor.

    Parameters
    ----------
    times : array_like of shape (n_pulses,)
        Pulse times [s] on the clock of the samples, increasing; see `pulse_times`.
    fs : float
        Sampling rate of the angle [Hz].
    n_times : int
        Number of samples of the angle, at 0, 1/fs, ...
    pulses_per_rev : float
        Pulses per revolution; not an integer if there is a gear in between.

    Returns
    -------
    TachoAngle
        The angle [rad], and the times [s] of the inserted and removed pulses.

    Raises
    ------
    ValueError, TypeError
        If the times are not finite and increasing, fewer than two lie in the recording, more than
        one pulse in ten (and three) is missing or double, or a gap (at an end, too) exceeds ten
        intervals.

    Warns
    -----
    EmacmWarning
        If more than three pulses in a hundred (and three in all) are missing or double, the
        intervals scatter so much that these may be overlooked, the speed changes so suddenly that
        they cannot be told from it, or it falls and rises again as where the shaft reverses.

    See Also
    --------
    emacm.angle_from_tacho : From the signal of a tachometer.
    emacm.pulse_times : Times of pulses in a signal.

    References
    ----------
    .. [1] Fritsch and Carlson, Monotone piecewise cubic interpolation, SIAM J. Numer. Anal.
       17 (1980): slopes of at most three times the nearest chords.

    Examples
    --------
    >>> turn = angle_from_pulses([0.0, 0.1, 0.2, 0.4, 0.5, 0.6], fs=20, n_times=13)
    >>> turn.missing.round(6), turn.double
    (array([0.3]), array([], dtype=float64))
    >>> (turn.angle / np.pi).round(6)
    array([ 0.,  1.,  2.,  3.,  4.,  5.,  6.,  7.,  8.,  9., 10., 11., 12.])
    """
    found = _repaired(times, fs, n_times, pulses_per_rev)
    _warn(found.statements)
    return found


def _repaired(times: ArrayLike, fs: float, n_times: int, pulses_per_rev: float) -> TachoAngle:
    pulses = check_signal(times, "times").astype(np.float64)
    fs = check_number(fs, "fs", above=0, unit="Hz")
    instants = np.arange(check_count(n_times, "n_times")) / fs
    per_rev = check_number(pulses_per_rev, "pulses_per_rev", above=0)
    _check_pulses(pulses, instants[-1])
    n_marks = int(per_rev) if per_rev.is_integer() else 1
    found = number_pulses(pulses, n_marks)
    kept, places = pulses[found.kept], found.places
    steps = np.diff(places)
    n_missing = found.n_irregular(n_marks) - round(float((steps[steps > 10] - 1).sum()))
    statements = _repair_statements(n_missing, len(pulses) - len(kept), len(pulses))
    speeds = np.log(steps / np.diff(kept))
    statements += _scatter_statements(speeds)
    statements += _doubt_statements(pulses[found.doubtful], kept, speeds)
    begin, end = (np.diff(kept) / np.diff(places))[[0, -1]]
    _check_gap(kept[0] / begin, f"before the first pulse at {kept[0]:.6g} s")
    _check_gap((instants[-1] - kept[-1]) / end, f"after the last pulse at {kept[-1]:.6g} s")
    for index in np.flatnonzero(steps > 10)[:1]:
        _check_gap(steps[index], f"after pulse {index} at {kept[index]:.6g} s")
    angle = (places - places[0]) / per_rev * 2 * np.pi
    missing = PchipInterpolator(places, kept)(found.marks.places(found.absent))
    double = np.delete(pulses, found.kept)
    return TachoAngle(_interpolated(kept, angle, instants), missing, double, statements)


def _repair_statements(n_missing: int, n_double: int, n_pulses: int) -> tuple[Statement, ...]:
    """State more repairs than a few in a hundred pulses; refuse more than one in ten.

    Of 75 simulations with 5 % of the pulses missing, in five motions with even and uneven marks, 73
    had the right number of turns, one was refused, and one was off by a mark beside a standstill.
    With noise that makes one double pulse in six, the number is not known.
    """
    n_repairs = n_missing + n_double
    text = f"{n_missing} missing and {n_double} double pulses among {n_pulses} of the tachometer"
    if n_repairs > max(3, 0.1 * n_pulses):
        raise ValueError(
            f"times must be pulses that follow the speed of a shaft, got {text}, so that the "
            f"number of turns is not known. Is there noise, does the level jump, are pulses "
            f"shorter than a sample, is pulses_per_rev right? Set threshold and hysteresis, or "
            f"repair the sensor."
        )
    if n_repairs <= max(3, 0.03 * n_pulses):
        return ()
    value = n_repairs / n_pulses
    return (Statement("tachometer", "", f"{text} were repaired", value=value, limit=0.03),)


def _scatter_statements(logs: Angle) -> tuple[Statement, ...]:
    """State a speed that scatters from pulse to pulse, in which repairs are uncertain.

    With pulses that jitter by 10 % of an interval, this is 0.09, and uneven marks are not always
    learned; by 5 %, 0.04.
    """
    bends = np.abs(logs[1:-1] - (logs[2:] + logs[:-2]) / 2)
    scatter = float(np.median(bends)) if len(bends) else 0.0
    if scatter < 0.07:
        return ()
    text = f"the intervals of the tachometer scatter by {100 * scatter:.2g} % from pulse to pulse, "
    text += "so that missing and double pulses may be overlooked: sample faster, or reduce noise"
    return (Statement("jitter", "", text, value=scatter, limit=0.07),)


def _doubt_statements(doubtful: Angle, kept: Angle, speeds: Angle) -> tuple[Statement, ...]:
    """State where the number of turns is not known, as where the shaft reverses.

    There the speed falls and rises again, faster from pulse to pulse: with constant deceleration by
    1.3 at least between the last two intervals before the longest, and by 1.8 in all.
    """
    turning = np.minimum(speeds[:-4] - speeds[1:-3], speeds[4:] - speeds[3:-1]) > np.log(1.25)
    lowest = minimum_filter1d(np.minimum(speeds, -np.log(np.diff(kept))), 3)[2:-2]
    turning &= np.minimum(speeds[:-4], speeds[4:]) - lowest > np.log(1.7)
    kind, times = "tachometer", doubtful
    found = "changes so suddenly that missing and double pulses cannot be told from it"
    if turning.any():
        kind, times = "reversal", kept[2:-3][turning]
        found = "falls and rises again as where the shaft reverses, and pulses do not show the "
        found += "direction"
    if not len(times):
        return ()
    place = f"at {times[0]:.4g} s ({len(times)} places in all)"
    text = f"{place} the speed {found}: the number of turns is not known"
    return (Statement(kind, "", text, True, len(times), 0),)


def _warn(statements: tuple[Statement, ...]) -> None:
    for statement in statements:
        warnings.warn(EmacmWarning(statement), stacklevel=3)


def angle_from_tacho(
    tacho: ArrayLike,
    fs: float,
    *,
    pulses_per_rev: float = 1,
    threshold: float | None = None,
    hysteresis: float | None = None,
    edge: str = "rising",
) -> TachoAngle:
    """Compute the shaft angle from a raw tacho channel: `pulse_times`, then `angle_from_pulses`.

    Measured error with sloped pulses at 10 kHz, 2 % of noise and about 10 rev/s: 5e-3 rad.

    Parameters
    ----------
    tacho, fs, threshold, hysteresis, edge
        See `pulse_times`.
    pulses_per_rev
        See `angle_from_pulses`.

    Returns
    -------
    TachoAngle
        The angle [rad] at every sample, and the repairs.

    Raises
    ------
    ValueError, TypeError
        As the two functions do.

    Warns
    -----
    EmacmWarning
        As the two functions do.

    See Also
    --------
    emacm.angle_from_pulses : From the times of pulses.
    emacm.angle_from_vibration : Without a tachometer.

    Examples
    --------
    >>> (angle_from_tacho([0, 0, 1, 1] * 5, fs=4).angle / (2 * np.pi)).round(3)[::4]
    array([-0.375,  0.625,  1.625,  2.625,  3.625])
    """
    options: Any = {"threshold": threshold, "hysteresis": hysteresis, "edge": edge}
    found = stated_angle(tacho, fs, pulses_per_rev=pulses_per_rev, **options)
    _warn(found.statements)
    return found


def stated_angle(
    tacho: ArrayLike, fs: float, *, pulses_per_rev: float = 1, **options: Any
) -> TachoAngle:
    """Compute the shaft angle as `angle_from_tacho` does, without warnings: for files."""
    times, statements = _stated_pulses(tacho, fs, **options)
    with located("the pulses of tacho"):
        found = _repaired(times, fs, len(np.asarray(tacho)), pulses_per_rev)
    return replace(found, statements=statements + found.statements)


def _check_levels(signal: Angle, low: float, high: float) -> None:
    if not high - low >= np.ptp(signal) / 2 > 0:
        raise ValueError(
            f"tacho must have two levels, got 99.8 % of its samples between {low:.6g} and "
            f"{high:.6g}, all between {signal.min():.6g} and {signal.max():.6g}: a flat channel, "
            f"narrow pulses or stray spikes. Check the sensor, or set threshold and hysteresis."
        )


def _check_pulses(pulses: Angle, end: float) -> None:
    falls = np.flatnonzero(np.diff(pulses) <= 0)
    if len(falls):
        raise ValueError(
            f"times must be pulse times in s that increase, got {pulses[falls[0] + 1]:.6g} at "
            f"pulse {falls[0] + 1}. For a raw tacho channel, call angle_from_tacho."
        )
    if np.count_nonzero((pulses >= 0) & (pulses <= end)) < 2:
        raise ValueError(
            f"times must hold at least two pulses from 0 to {end:.6g} s, got {len(pulses)} from "
            f"{pulses[0]:.6g} to {pulses[-1]:.6g}. Are they in s, and fs and n_times right?"
        )


def _check_gap(due: float, place: str) -> None:
    if due > 10:
        raise ValueError(
            f"times must leave gaps of at most 10 intervals, got one of {due:.4g} "
            f"{place}: a standstill or a sensor lost. Cut the recording there."
        )


def _interpolated(pulses: Angle, angle: Angle, instants: Angle) -> Angle:
    """Interpolate by a cubic spline held monotone, and go on straight beyond its ends."""
    chords = np.diff(angle) / np.diff(pulses)
    limit = 3 * np.minimum(np.append(chords[0], chords), np.append(chords, chords[-1]))
    slopes = np.clip(CubicSpline(pulses, angle)(pulses, 1), 0, limit)
    inside = CubicHermiteSpline(pulses, angle, slopes)(np.clip(instants, pulses[0], pulses[-1]))
    early, late = np.minimum(instants - pulses[0], 0), np.maximum(instants - pulses[-1], 0)
    return inside + slopes[0] * early + slopes[-1] * late
