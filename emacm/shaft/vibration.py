"""Shaft angle from vibration alone, without any shaft sensor.

The numbers here, in `speed_evidence` and in `phase_refinement` were chosen on simulated machines,
none of which is among the 100 units in the notes of `angle_from_vibration`; no benchmark of this
repository repeats the choice. ``pytest tests/shaft/test_vibration.py`` checks the results.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft, ndimage
from scipy.integrate import cumulative_trapezoid

from emacm._checks import check_number, check_orders, check_signal
from emacm.shaft.phase_refinement import Course, refined_speed
from emacm.shaft.speed_evidence import Evidence, Whitened, find_comb, find_shaft, measure, whiten

Array = NDArray[np.floating]


class Confidence(NamedTuple):
    """Reliability of a shaft angle.

    Attributes
    ----------
    fraction : float
        Fraction of the seconds that are reliable.
    reliable : ndarray of bool, shape (n_seconds,)
        Which seconds of the signal are reliable; the last one may be shorter.
    """

    fraction: float
    reliable: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class VibrationAngle:
    """Shaft angle and speed found in a vibration signal.

    Attributes
    ----------
    angle : ndarray of shape (n_times,)
        Shaft angle [rad], 0 at the first sample. The direction of rotation is not known: it
        always rises.
    velocity : ndarray of shape (n_times,)
        Speed of the shaft [rad/s]. In seconds that are not reliable, it is interpolated.
    confidence : Confidence
        Fraction of reliable seconds, and which they are.
    """

    angle: Array
    velocity: Array
    confidence: Confidence


def angle_from_vibration(
    signal: ArrayLike,
    fs: float,
    *,
    speeds: tuple[float, float],
    orders: Sequence[float] | None = None,
    parts: Any = None,
) -> VibrationAngle:
    """Find the shaft angle in a vibration signal, without any shaft sensor.

    Parameters
    ----------
    signal : array_like of shape (n_times,)
        Vibration, or another signal with lines at orders of the shaft, such as a current.
    fs : float
        Sampling rate [Hz].
    speeds : (float, float)
        Lowest and highest possible speed of the shaft [rad/s]. The narrower the range, the more
        seconds are reliable, because speeds outside are excluded. From a factor of 1.5 between
        them on, `orders` or `parts` are needed.
    orders : sequence of float, optional
        Orders at which the signal has lines, such as the tooth number of a gear. Default: some of
        1, 2, 3, ..., 24, the first ones before the others.
    parts : part, mapping of str to float, or sequence of these, optional
        `Bearing`, `Gear` and so on, or known orders by name, one of which has lines in the signal
        (usually because it is damaged). Used in a wide range without `orders` only.

    Returns
    -------
    VibrationAngle
        `angle` [rad] and `velocity` [rad/s] at the samples of the signal, for
        ``Recording(..., angle=found.angle)``, and `confidence`.

    Raises
    ------
    TypeError, ValueError
        If the signal is not a finite numeric signal, a parameter is out of range, or no second
        is reliable; the message gives the best speed, and what is missing.

    See Also
    --------
    emacm.angle_from_tacho : From a tachometer, which is more certain.
    emacm.find_faults : Names faults at a known speed.

    Notes
    -----
    The lines of all orders are evaluated on one grid of speeds (multi-order probabilistic
    approach [1]_): the evidence for a speed is a sum of log likelihood ratios over its orders, by
    the rank of the power in the spectrum, in frames of 4 s or 1.4 s, which are warped by several
    rates of change. The most likely speed over time with a bounded rate of change is found by the
    Viterbi algorithm. It is compared with all other speeds, in particular its multiples and
    fractions: a second is reliable only if its log likelihood ratio to *every* other speed is
    at least 4 (10 in the shorter frames), the speed is not at an end of `speeds`, and the lines
    keep their level and phase in all parts of it, once they are demodulated. The phases of the
    clear orders that agree on one speed refine it; beside the sidebands of a bearing frequency,
    their spacing is the speed.

    The method is for speed changes of up to 1 % within a few seconds. On simulated machines with 3
    to 12 lines, at 0 and -10 dB, the median error was 0.01 % and every reliable second within 1 %;
    two thirds of the seconds were reliable at constant speed, half at a drift of 1 %. Faster ramps
    are mostly refused. A machine that reverses all the time has lines at all multiples of the
    frequency of its motion, between the orders too; it is refused for that. A single reversal or
    rest between long strokes makes the lines vanish for a moment, and gives each of them another
    phase. The second in which it lies is not reliable, nor is a second whose edge is near; where
    there are only one or two lines, a very short reversal may be missed, since their phases may
    agree by chance.

    On the simulated bench, a phase current (``orders=[5, 6, 7, 30, 42]``, 6 pole pairs) with noise
    at 0 dB, 100 units that were not used for any choice, speeds of 40 to 320 rad/s, in strokes of
    1.5 to 10 s at constant speed and in sines: 306 of 307 reliable seconds were right with `speeds`
    from 0.86 to 1.12 times the true speed, 231 of 232 with 0.5 to 1.5 times, with a median error of
    0.003 % (right: mean speed within 1 %, no reversal in the second). These are 4 to 5 % of the
    seconds of constant speed: a current has one clear line, or three at a high load. The
    accelerometer has lines of its rolling elements only. Of 4568 reliable seconds of other
    simulated machines with 2 to 12 lines, at -10 to 5 dB, with reversals and rests of 0.02 to 2 s,
    4565 were right.

    In a range below 1.5 to 1, a constant speed is first looked for by a comb: the orders 1 to 6 in
    the spectrum of the whole signal must stand out by 14 dB on average, and by 5.5 dB more than
    those of any other speed. **In a wider range a bearing whose shaft has no clear lines of its own
    cannot be told from a shaft**, so no speed is certain there without `parts`. With them, the
    speed must be constant, and the orders of the shaft must stand out together with the lines of a
    part at its own orders: by 14 dB each, and by 3 dB more, on average of all lines, than at any
    other speed. A shaft without any line of a part is refused: its lines could be those of a part.

    ``benchmarks/angle_from_vibration.py``: of the CWRU recordings of the drive end and half of
    those of UESTC, on which this was chosen, 74 of 82 had the right speed (within 0.5 %) in ranges
    of ±10 % and of a factor of 1.5, and none a wrong one; from 5 to 60 Hz with `parts` 29 and none.
    Of the others (fan end, MFPT, other half) 73 of 81 and 1 wrong, and 37 and none. Of 150
    simulated bearings with weak shafts, 45 and 10 wrong in ±10 %, 23 and 1 from 5 to 60 Hz. There,
    a line at nearly 3, 4 or 5 times the speed (BPFO 3.05) may be taken for that order, which makes
    the speed 0.5 to 2.5 % wrong, also in a narrow range.

    Without `orders`, the first orders are assumed to have lines: for a shaft with lines at even
    orders only, twice the true speed is found, unless `speeds` excludes that. Two orders at least
    are needed. Steady lines at multiples of 50 and 60 Hz are taken for the mains and ignored, so a
    shaft of exactly such a speed is found by its other orders only, if at all.

    References
    ----------
    .. [1] Leclère, André and Antoni, A multi-order probabilistic approach for instantaneous
       angular speed tracking, Mech. Syst. Signal Process. 81 (2016).

    Examples
    --------
    >>> fs, rng = 2000, np.random.default_rng(1)
    >>> t = np.arange(8 * fs) / fs
    >>> angle = 2 * np.pi * (21.3 * t + 0.1 * np.sin(t))
    >>> vibration = sum(np.cos(k * angle) for k in range(1, 9)) + rng.normal(size=len(t))
    >>> found = angle_from_vibration(vibration, fs, speeds=(110, 160))
    >>> found.confidence.fraction
    1.0
    >>> bool(np.abs(found.velocity / np.gradient(angle, 1 / fs) - 1).max() < 0.01)
    True
    """
    samples = check_signal(signal, "signal", min_length=64).astype(np.float64)
    fs = check_number(fs, "fs", above=0, unit="Hz")
    if not np.ptp(samples) > 0:
        raise ValueError("signal is constant, so it has no lines. Is the sensor connected?")
    limits = _checked_speeds(speeds, fs)
    known = None if orders is None else np.sort(check_orders(orders))
    lines = np.arange(1.0, 25) if known is None else known
    steady_speed = None
    if known is None:
        is_narrow = limits[1] < 1.5 * limits[0]
        search = _speed_in_narrow_range if is_narrow else partial(_speed_by_parts, parts)
        steady_speed = search(samples, fs, limits)
    best = (
        _best_course(samples, fs, limits, known, lines)
        if steady_speed is None
        else _steady_course(samples, fs, limits, steady_speed, lines)
    )
    times = np.arange(len(samples)) / fs
    reliable = best.reliable
    if reliable.any():
        speed, steady = refined_speed(best, lines)
        reliable = reliable & steady
    if not reliable.any():
        raise ValueError(best.refusal)
    velocity = 2 * np.pi * np.interp(times, np.arange(len(speed)) / best.white.fs, speed)
    angle = cumulative_trapezoid(velocity, dx=1 / fs, initial=0)
    return VibrationAngle(angle, velocity, Confidence(float(reliable.mean()), reliable))


def _speed_in_narrow_range(signal: Array, fs: float, limits: tuple[float, float]) -> float | None:
    """Return a constant speed, if its first orders stand out in the whole signal."""
    length = len(signal) / fs
    if length * limits[0] / 3 < 8:  # bins; fewer cannot tell the speeds of the range apart
        return None
    comb = find_comb(signal, fs, limits)
    inside = limits[0] + 2 / length < comb.speed < limits[1] - 2 / length
    halves = comb.speed * 2 / np.array([50.0, 60.0])  # of the frequency of the mains
    is_mains = np.abs(halves - np.rint(halves)).min() < 1e-3
    is_clear = comb.level >= 14 and comb.margin >= 5.5  # dB
    return comb.speed if inside and is_clear and not is_mains else None


def _steady_course(
    signal: Array, fs: float, limits: tuple[float, float], speed: float, lines: Array
) -> Course:
    """Return the course of a constant speed."""
    length = len(signal) / fs
    duration = min(4.0, length)
    highest = min(0.45 * fs, float(lines.max()) * limits[1])
    white = whiten(signal, fs, highest, duration)
    refusal = (
        f"no second of the signal shows a steady shaft: the lines of {2 * np.pi * speed:.5g} "
        f"rad/s change their level or phase. Narrow speeds, or use a shaft sensor."
    )
    n_seconds = max(1, int(np.ceil(length - 0.05)))
    every = np.ones(n_seconds, bool)
    centre, speeds, rate = (np.array([value]) for value in (length / 2, speed, 0.0))
    return Course(white, centre, speeds, rate, np.ones(1, bool), duration, every, refusal)


def _speed_by_parts(parts: Any, signal: Array, fs: float, limits: tuple[float, float]) -> float:
    """Return the constant speed in a wide range that the lines of the parts confirm.

    Without parts, a damaged bearing whose shaft has no clear lines cannot be told from a shaft.
    """
    low, high = 2 * np.pi * np.array(limits)
    refusal = (
        f"no second of the signal shows a speed between {low:.4g} and {high:.4g} rad/s for certain:"
    )
    if parts is None:
        likely = 2 * np.pi * find_comb(signal, fs, limits).speed
        raise ValueError(
            f"{refusal} in a range wider than 1.5 to 1, the lines of a bearing or a gear may be "
            f"taken for those of a shaft. Lines at 1 to 6 times {likely:.5g} rad/s stand out most. "
            f"Narrow speeds, or give the bearings and gears of the machine as parts."
        )
    comb = find_shaft(signal, fs, limits, _families(parts))
    # At a margin of 3 dB, no speed was wrong on 150 simulated bearings, the drive end of CWRU and
    # half of UESTC. In fewer than 50 revolutions, lines of a cage (0.40) and of a bearing (3.6)
    # look like multiples of a fraction of the speed.
    if comb.level < 14 or comb.margin < 3 or comb.speed * len(signal) / fs < 50:
        raise ValueError(
            f"{refusal} at {2 * np.pi * comb.speed:.5g} rad/s in {len(signal) / fs:.3g} s, the "
            f"lines of the shaft or of the parts stand out by {comb.level:.2g} dB, where "
            f"14 are needed, by {comb.margin:.2g} dB more than at any other "
            f"speed, where 3 are needed, and 50 revolutions. Narrow speeds, or use a shaft sensor."
        )
    return comb.speed


def _families(parts: Any) -> list[tuple[float, float]]:
    """Return limits of the first order of each family of lines of parts, off those of the shaft."""
    families = []
    for part in parts if isinstance(parts, Sequence) else [parts]:
        if isinstance(part, Mapping):
            series = [(check_number(part[name], name, above=0), True) for name in part]
        elif hasattr(part, "lines"):
            series = [(line.order * line.strikes, line.slips) for line in part.lines()]
        else:
            raise TypeError(f"parts must be such as Bearing(9, 7.94, 39.04), got {part!r}.")
        for order, slips in series:
            low, high = order * np.array((0.98, 1.005) if slips else (1.0, 1.0))
            # So far from an order of the shaft, the two can be told apart.
            below, above = round(order) + np.array([-0.02, 0.02])
            sides = (low, min(high, below)), (max(low, above), high)
            families.append(max(sides, key=lambda side: side[1] - side[0]))
    off_orders = [(low, high) for low, high in families if low <= high]
    if not off_orders:
        raise ValueError(
            "parts has no line off the orders of the shaft. Give bearings, too, or narrow speeds."
        )
    return off_orders


def _best_course(
    signal: Array, fs: float, limits: tuple[float, float], orders: Array | None, lines: Array
) -> Course:
    """Return the course from frames of the duration with the most reliable seconds.

    The speed is within limits [Hz]; `lines` are the orders, or those that are assumed.
    """
    longest = len(signal) / fs
    # 17 cycles of the smallest distance of two orders separate their lines.
    shortest = 17 / (limits[0] * float(np.diff(lines, prepend=0).min()))
    if longest < shortest:
        raise ValueError(
            f"signal lasts {longest:.3g} s, but {shortest:.3g} s are needed to separate the orders "
            f"at the lowest speed. Raise the lowest of speeds, or give a longer signal."
        )
    courses: list[Course] = []
    # Durations [s], rates of change, log likelihood ratios needed, and numbers of orders that may
    # have lines. Long frames give most evidence, short ones follow faster changes, but do not
    # separate the lines of high orders.
    many, few = (4, 6, 8, 12, 16, 24), (4, 6, 8)
    for frame, n_rates, margin, counts in ((4.0, 5, 4.0, many), (1.4, 15, 10.0, few)):
        if courses and not shortest < frame < longest:
            continue
        duration = max(min(frame, longest), shortest)
        highest = min(0.45 * fs, float(lines.max()) * limits[1])
        white = whiten(signal, fs, highest, duration)
        evidence = measure(white, duration, limits, orders, n_rates=n_rates, counts=counts)
        courses.append(_course(white, evidence, limits, lines, longest, margin))
        if courses[-1].reliable.mean() >= 0.9:
            break
    return max(courses, key=lambda course: course.reliable.sum())


def _course(
    white: Whitened,
    evidence: Evidence,
    limits: tuple[float, float],
    lines: Array,
    longest: float,
    margin: float,
) -> Course:
    path = _most_likely_path(evidence, evidence.ratios)
    frames, speeds = np.arange(len(path)), evidence.speeds[path]
    same_speed = 0.004  # relative distance of speeds that count as one
    margins, sums = _margins(evidence, speeds, same_speed)
    needed = np.log(len(evidence.speeds))
    trusted = (margins >= margin) & (sums >= needed)
    trusted &= speeds > limits[0] * (1 + same_speed)
    trusted &= speeds < limits[1] * (1 - same_speed)
    trusted &= evidence.ratios[frames, path] >= 2  # every single frame tells it from noise
    rates = evidence.rates[frames, path]
    n_frame = round(evidence.duration * white.fs)
    for number in np.flatnonzero(trusted):
        start = max(0, round(evidence.times[number] * white.fs) - n_frame // 2)
        motion = white.signal[start : start + n_frame], speeds[number], rates[number]
        trusted[number] = orders_stand_out(*motion, lines, white.fs, white.highest)
    # A second is reliable if all frames whose nearest times lie in it are trusted.
    edges = (evidence.times[1:] + evidence.times[:-1]) / 2
    seconds = np.arange(max(1, int(np.ceil(longest - 0.05))))
    first = np.searchsorted(edges, seconds)
    last = np.searchsorted(edges, np.minimum(seconds + 1.0, longest) - 1e-9)
    reliable = np.array([trusted[i : j + 1].all() for i, j in zip(first, last, strict=True)])
    top = int(np.argmax(margins))
    low, high, best = 2 * np.pi * np.array([*limits, speeds[top]])
    refusal = (
        f"no second of the signal shows a speed between {low:.4g} and {high:.4g} rad/s reliably. "
        f"The best, {best:.5g} rad/s at {evidence.times[top]:.3g} s, has a log likelihood ratio of "
        f"{margins[top]:.2g} to any other one, where {margin:g} is needed, and of "
        f"{sums[top]:.2g} to noise, where {needed:.2g} is needed; few other lines may lie between "
        f"its orders. Narrow speeds, state the orders of known lines, or use a shaft sensor."
    )
    return Course(
        white, evidence.times, speeds, rates, trusted, evidence.duration, reliable, refusal
    )


def _most_likely_path(evidence: Evidence, scores: Array) -> NDArray[np.intp]:
    """Return the indices of the speeds with the most evidence and bounded steps (Viterbi)."""
    step = evidence.speeds[1] - evidence.speeds[0]
    reach = int(np.ceil(evidence.fastest * evidence.duration / 2 * evidence.speeds[-1] / step)) + 1
    totals = [scores[0]]
    for ratios in scores[1:]:
        before = ndimage.maximum_filter1d(totals[-1], 2 * reach + 1, mode="constant", cval=-np.inf)
        totals.append(before + ratios)
    path = [int(np.argmax(totals[-1]))]
    for total in reversed(totals[:-1]):
        low = max(0, path[-1] - reach)
        path.append(low + int(np.argmax(total[low : path[-1] + reach + 1])))
    return np.array(path[::-1])


def _margins(evidence: Evidence, speeds: Array, same_speed: float) -> tuple[Array, Array]:
    """Return log likelihood ratios of the path to its best rival and to noise.

    Rivals are the speeds in a constant ratio to the path, so that no multiple or fraction is
    forgotten, and the most likely path elsewhere, which is as free as the path itself. No frame
    excludes a speed alone.
    """
    grid = evidence.speeds
    step = grid[1] - grid[0]
    # A line is as wide as the resolution, whatever its order.
    same = np.maximum(same_speed, 2.0 / (evidence.duration * speeds))[:, np.newaxis]
    lowest = -100.0
    scores = np.maximum(evidence.ratios, lowest)
    elsewhere = np.where(np.abs(grid / speeds[:, np.newaxis] - 1) <= same, lowest, scores)
    second = grid[_most_likely_path(evidence, elsewhere)]
    n_ratios = 2 * int(np.log(grid[-1] / grid[0]) / (step / grid[-1])) + 1
    ratios = np.exp(np.linspace(-1, 1, n_ratios) * np.log(grid[-1] / grid[0]))
    rigid = _scores_at(scores, grid, ratios * speeds[:, np.newaxis])
    own = np.abs(ratios - 1) <= same
    mine = np.where(own, rigid, -np.inf).max(axis=1)
    rigid[own] = -np.inf
    free = _scores_at(elsewhere, grid, second[:, np.newaxis])[:, 0]
    return mine - np.maximum(rigid.max(axis=1), free), mine


def _scores_at(scores: Array, grid: Array, speeds: Array) -> Array:
    """Return the scores at some speeds, summed over neighbouring frames.

    Three neighbouring frames see the same lines and so count half.
    """
    places = np.rint((speeds - grid[0]) / (grid[1] - grid[0])).astype(np.intp)
    inside = (places >= 0) & (places < len(grid))
    at_speeds = np.take_along_axis(scores, np.clip(places, 0, len(grid) - 1), axis=1)
    at_speeds = np.where(inside, at_speeds, -4.0)  # speeds outside of the grid are unlikely
    width = min(3, len(at_speeds))
    summed: Array = ndimage.uniform_filter1d(at_speeds, width, axis=0, mode="nearest")
    return summed * (max(width, 2) / 2)


def _checked_speeds(speeds: tuple[float, float], fs: float) -> tuple[float, float]:
    """Return lowest and highest speed [Hz]."""
    if not isinstance(speeds, Sequence | np.ndarray) or len(speeds) != 2:
        raise TypeError(f"speeds must be a pair (lowest, highest) of rad/s, got {speeds!r}.")
    low = check_number(speeds[0], "the lowest speed", above=0, unit="rad/s")
    # A quarter of the sampling rate: the second order must be below half of it.
    limits: dict[str, Any] = {"above": low, "below": np.pi * fs / 2, "unit": "rad/s"}
    high = check_number(speeds[1], "the highest speed", **limits)
    return low / (2 * np.pi), high / (2 * np.pi)


def orders_stand_out(
    frame: Array, speed: float, rate: float, orders: Array, fs: float, highest: float
) -> bool:
    """Tell whether few other positions between the orders have as many lines as the orders.

    A machine that repeats its motion, such as an actuator that reverses all the time, has lines at
    all multiples of the frequency of repetition. Any multiple of this frequency then looks like a
    speed. Where these lines are too close together to be counted, they are recognised by two
    properties: they are evenly spaced, and together they are a signal whose level varies during the
    motion. A damaged bearing may have evenly spaced lines too, and a shaft in noise a level that
    varies, but not both.

    Parameters
    ----------
    frame : ndarray of shape (n_times,)
        Signal with a flat background.
    speed : float
        Speed at the centre of the frame [Hz].
    rate : float
        Relative rate of change of the speed [1/s].
    orders : ndarray of shape (n_orders,)
        Orders with lines, ascending.
    fs : float
        Sampling rate [Hz].
    highest : float
        Highest frequency in the signal [Hz].

    Returns
    -------
    bool
        False if lines are everywhere between the orders.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(8000) / 2000
    >>> noise = 0.1 * np.random.default_rng(0).normal(size=len(t))
    >>> shaft = sum(np.cos(2 * np.pi * 20 * k * t + k * k) for k in range(1, 9))
    >>> orders_stand_out(shaft + noise, 20.0, 0.0, np.arange(1.0, 9), 2000, 1000)
    True
    >>> repeated = sum(np.cos(2 * np.pi * 2 * k * t + k * k) for k in range(1, 90))
    >>> orders_stand_out(repeated + noise, 20.0, 0.0, np.arange(1.0, 9), 2000, 1000)
    False
    """
    n_times = len(frame)
    centred = (np.arange(n_times) - (n_times - 1) / 2) / fs
    frame = np.interp(centred, centred + rate * centred**2 / 2, frame)
    n_bins = int(highest * n_times / fs) + 1
    power = np.abs(fft.rfft(frame * np.hanning(n_times))[:n_bins]) ** 2
    raw = np.clip(np.log(np.maximum(power, 1e-300) / np.median(power)), 0, 4)  # all alike above
    heights = ndimage.maximum_filter1d(raw, 3)
    revolutions = speed * n_times / fs
    gap = revolutions * float(np.diff(orders, prepend=0.0).min())
    half = int(gap / 2)
    places = np.rint(orders[:, np.newaxis] * revolutions).astype(np.intp)
    places = places + np.arange(-half, half + 1)
    inside = places[:, -1] < len(heights)
    n_needed = 8  # bins for each family of lines
    if half < n_needed or not inside.any():  # too little is between the orders
        return False
    mean = heights[places[inside]].mean(axis=0)
    own = mean[half - 1 : half + 2].max()
    mean[half - 3 : half + 4] = 0  # a line is three bins wide, either way
    like = ndimage.maximum_filter1d(mean, 7, mode="wrap") == mean
    like &= mean >= max(0.65 * own, 1e-9)
    # A damaged bearing has a family of lines for each harmonic; seven can be counted.
    if int(like.sum()) > min(7, 2 * half // n_needed):
        return False
    # In windows of five revolutions, the lines of a repeated motion are not separate.
    if _level_scatter(frame, orders[inside] * speed, 5 / speed, fs) < 1.15:
        return True
    return _evenness(raw, places[inside, half], gap) < 0.1


def _evenness(heights: Array, places: NDArray[np.intp], gap: float) -> float:
    """Return the contrast of evenly spaced lines between orders, relative to that of the orders.

    Lines of a repeated motion are at all m-th parts of the distance of two orders, and none is
    halfway between two of them.
    """
    across = np.minimum(places[:, np.newaxis] + np.arange(int(gap)), len(heights) - 1)
    profile = heights[across].mean(axis=0)
    own = profile[[-1, 0, 1]].max() - np.median(profile)
    most = 0.0
    for m in range(8, int(gap / 2.5) + 1):  # lines that are too many to be counted, 2.5 bins apart
        lines = np.rint(np.arange(1, m) * gap / m).astype(np.intp)
        halfway = np.rint((np.arange(m - 1) + 0.5) * gap / m).astype(np.intp)
        # Some lines may be weak and some between may be high, but not many.
        low, high = np.quantile(profile[lines], 0.25), np.quantile(profile[halfway], 0.75)
        most = max(most, float(low - high))
    return most / max(float(own), 1e-9)


def _level_scatter(frame: Array, frequencies: Array, duration: float, fs: float) -> float:
    """Return the scatter of the mean level of lines over time, relative to that of noise.

    The logarithm of the power of noise in one bin has a variance of pi²/6.
    """
    n_window = round(duration * fs)
    windows = np.lib.stride_tricks.sliding_window_view(frame, n_window)[:: max(1, n_window // 2)]
    spectra = np.abs(fft.rfft(windows * np.hanning(n_window + 2)[1:-1])) ** 2
    bins = np.rint(frequencies * n_window / fs).astype(np.intp)
    levels = np.log(np.maximum(spectra[:, bins], 1e-300)).mean(axis=1)
    return float(levels.std() / (np.pi / np.sqrt(6 * len(frequencies))))
