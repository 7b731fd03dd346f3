"""Which mark of a tachometer each pulse belongs to: missing, double and uneven marks.

The marks of one revolution may be uneven: a tape with a butt joint, a wheel with a gap. Their
intervals repeat in each revolution, those of a missing or a double pulse do not. So the numbers of
the pulses are found together with the spacing of the marks: of several spacings, that one is taken
with which the speed of the shaft is smoothest and the fewest pulses are repaired.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from math import inf, log
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

# Cost of a gap and of a double pulse, beside changes of the logarithm of the speed. A missing pulse
# that is not noticed halves the speed and doubles it again: twice 0.69; a double one changes it
# by 2 and more. An outermost interval of half the length (0.69) is not taken for a double pulse.
_GAP, _DOUBLE = 0.3, 0.85


class Marks(NamedTuple):
    """Places of the marks of a tachometer, in mean intervals.

    Attributes
    ----------
    within : tuple of float
        Of the marks of one revolution, the first one at 0; (0.0,) if they are even.
    """

    within: tuple[float, ...] = (0.0,)

    def place(self, number: int) -> float:
        """Return the place of a mark by its number, counted on over all revolutions."""
        n_marks = len(self.within)
        return number // n_marks * n_marks + self.within[number % n_marks]

    def places(self, number: Numbers) -> Array:
        """Return the places of several marks."""
        n_marks = len(self.within)
        return np.asarray(number // n_marks * n_marks + np.array(self.within)[number % n_marks])

    def near(self, place: float) -> int:
        """Return the number of the mark nearest to a place."""
        n_marks = len(self.within)
        below = int(place // n_marks) * n_marks
        below += bisect_right(self.within, place - below) - 1
        return below + int(self.place(below) + self.place(below + 1) < 2 * place)

    @property
    def reverse(self) -> Marks:
        """The marks in the opposite direction, from the same one."""
        return Marks(tuple(-self.place(-number) for number in range(len(self.within))))


class NumberedPulses(NamedTuple):
    """Numbers of pulses.

    Attributes
    ----------
    kept : ndarray of shape (n_kept,)
        Which pulses are kept; the others are double.
    number : ndarray of shape (n_kept,)
        Numbers of their marks, counted on over all revolutions.
    marks : Marks
        The places of the marks.
    cost : float
        Sum of changes of the logarithm of the speed, and of the costs of repairs.
    doubtful : list of int
        Pulses beside which others may also be numbered otherwise.
    """

    kept: Numbers
    number: Numbers
    marks: Marks
    cost: float
    doubtful: list[int] = []  # noqa: RUF012

    @property
    def places(self) -> Array:
        """Places of the pulses that are kept, in mean intervals."""
        return self.marks.places(self.number)

    @property
    def absent(self) -> Numbers:
        """Numbers of the missing pulses."""
        return np.setdiff1d(np.arange(self.number[0], self.number[-1]), self.number)

    def n_irregular(self, n_marks: int) -> int:
        """Return the number of missing pulses, without those of a gap in an even wheel."""
        lacking = np.bincount(self.absent % n_marks, minlength=n_marks)
        n_turns = (self.number[-1] - self.number[0]) // n_marks
        is_gap = (lacking > n_turns / 2) & (min(n_marks, n_turns) > 1) & (self.marks == Marks())
        return int(lacking[~is_gap].sum())


class _Trace(NamedTuple):
    """One way to number the pulses up to a certain one.

    Attributes
    ----------
    cost : float
        Of this way.
    number : int
        Of the last pulse that is kept.
    n_plain : int
        Number of steps to the next mark since the last repair or change of speed.
    recent : tuple of (float, float)
        Times and places of the last pulses, five at most.
    path : tuple
        Index and number of the last pulse that is kept, and the path before.
    margin : float
        By how much a way to another number costs more.
    """

    cost: float
    number: int
    n_plain: int
    recent: tuple[tuple[float, float], ...]
    path: Any
    margin: float = inf


def number_pulses(times: Array, n_marks: int) -> NumberedPulses:
    """Find the marks of the pulses of a tachometer.

    Parameters
    ----------
    times : ndarray of shape (n_pulses,)
        Increasing times of pulses [s].
    n_marks : int
        Marks of a revolution; 1 if their spacing cannot be learned.

    Returns
    -------
    NumberedPulses
    """
    logs = np.log(np.diff(times))
    every = np.arange(len(times))
    if len(logs) < 3:
        return NumberedPulses(every, every, Marks(), 0.0)
    if len(logs) < 2 * n_marks:  # the spacing must be seen to repeat
        n_marks = 1
    change = logs[n_marks:] - logs[:-n_marks] if n_marks > 1 else logs
    bend = change[1:-1] - (change[2:] + change[:-2]) / 2
    noise = min(3 * float(np.median(np.abs(bend))), 0.4) if len(bend) else 0.0
    n_known = min(5, max(3, len(times) // 2))
    bends = sliding_window_view(np.abs(np.diff(logs, prepend=logs[0])), n_known - 1)
    calm = int(np.argmin(bends.sum(axis=-1)))
    starts = [(Marks(), calm)]
    if n_marks > 1:
        first, turn = _repeated_turn(logs, n_marks, n_known - 1)
        marks = _uneven(np.roll(turn, first))
        starts = [(marks, first), *starts] if marks != Marks() else starts
    best = NumberedPulses(every, every, Marks(), inf)
    for marks, first in starts:
        found = _numbered(times, marks, first, n_known, noise, best.cost)
        while found.cost < 0.99 * best.cost:
            best = found
            marks = _uneven(_shape(times, best, n_marks)) if n_marks > 1 else Marks()
            if marks == Marks():
                break
            found = _numbered(times, marks, first, n_known, noise, best.cost)
    return best


def _repeated_turn(logs: Array, n_marks: int, n_known: int) -> tuple[int, Array]:
    """Return the intervals of the revolution that others resemble most, and where it begins.

    Those without a missing or double pulse resemble each other, if they begin at the same mark.
    """
    length = -(-n_known // n_marks) * n_marks
    turns = sliding_window_view(logs[: 2 * length + 1_000_000 // length], length)
    turns = turns - turns.mean(axis=1, keepdims=True)
    calmest = np.argsort(np.abs(np.diff(turns, axis=1)).sum(axis=1))
    n_alike = 2 + len(turns) // (20 * n_marks)  # itself, and a few of those from the same mark
    best: tuple[float, int, Array] = inf, 0, turns[0]
    for first in calmest[np.unique(np.geomspace(1, len(turns), 40).astype(int)) - 1]:
        distance = ((turns - turns[first]) ** 2).sum(axis=1)
        nearest = np.argpartition(distance, n_alike - 1)[:n_alike]
        if distance[nearest].sum() < best[0]:
            best = float(distance[nearest].sum()), int(first), np.median(turns[nearest], axis=0)
    return best[1], best[2][:n_marks]


def _numbered(
    times: Array, marks: Marks, first: int, n_known: int, noise: float, limit: float
) -> NumberedPulses:
    """Follow the pulses from calm ones to both ends; the mark of pulse `first` is `first`."""
    last = first + n_known - 1
    later, number, cost, doubtful = _followed(times[first:], marks, first, n_known, noise, limit)
    before, opposite, more, others = _followed(
        -times[last::-1], marks.reverse, -last, n_known, noise, limit - cost
    )
    kept = np.concatenate([last - before[: n_known - 1 : -1], first + later])
    return NumberedPulses(
        kept,
        np.concatenate([-opposite[: n_known - 1 : -1], number]),
        marks,
        cost + more,
        [*(last - place for place in others[::-1]), *(first + place for place in doubtful)],
    )


def _followed(
    times: Array, marks: Marks, first: int, n_known: int, noise: float, limit: float
) -> tuple[Numbers, Numbers, float, list[int]]:
    """Return which pulses are kept, their numbers, the cost, and doubtful parts, to the end.

    A part is doubtful if another number costs less than 0.35 more. In simulations, it cost more
    with up to 5 % of the pulses missing, or one double, and 0.2 at most where the number was wrong.
    """
    kept, number = [*range(n_known)], [*range(first, first + n_known)]
    cost, is_calm, doubtful = 0.0, False, []
    while kept[-1] + 1 < len(times) and cost < limit:
        if is_calm:
            more, n_more = _plain(times, marks, kept[-1], number[-1])
            cost += more
            kept += range(kept[-1] + 1, kept[-1] + 1 + n_more)
            number += range(number[-1] + 1, number[-1] + 1 + n_more)
            if kept[-1] + 1 == len(times):
                break
            n_sure = max(n_known, len(kept) - 2)  # the last ones may be double
            del kept[n_sure:], number[n_sure:]
        last = zip(kept[-5:], number[-5:], strict=True)
        recent = tuple((float(times[k]), marks.place(n)) for k, n in last)
        traces = [_Trace(cost, number[-1], 0, recent, None)]
        for index in range(kept[-1] + 1, len(times)):
            time = float(times[index])
            traces = _best(
                [new for old in traces for new in _continued(old, index, time, marks, noise)], marks
            )
            is_calm = traces[0].n_plain >= 4
            if is_calm:
                break
        others = [t.cost - traces[0].cost for t in traces if t.number != traces[0].number]
        if is_calm and min([traces[0].margin, *others]) < 0.35:
            doubtful.append(kept[-1])
        cost, path, steps = traces[0].cost, traces[0].path, []
        while path is not None:
            *step, path = path
            steps.append(step)
        kept += [k for k, _ in steps[::-1]]
        number += [n for _, n in steps[::-1]]
        if index + 1 == len(times):
            break
    return np.array(kept), np.array(number), cost, doubtful


def _best(traces: list[_Trace], marks: Marks) -> list[_Trace]:
    """Return the cheapest traces, those only that will differ."""
    different: dict[Any, _Trace] = {}
    for trace in sorted(traces):
        (since, low), (last, high) = trace.recent[-2:]
        mark = trace.number % len(marks.within)
        key = (mark, last, since, round(high - low, 3))
        first = different.setdefault(key, trace)
        if first.number != trace.number:
            margin = min(first.margin, trace.cost - first.cost)
            different[key] = first._replace(margin=margin)
    # Of those without a gap as many: after a wrong speed, most traces have one in each step.
    plain = [t for t in different.values() if t.recent[-2][1] == marks.place(t.number - 1)]
    others = [t for t in different.values() if t.recent[-2][1] != marks.place(t.number - 1)]
    return sorted(plain[:8] + others[:8])


def _continued(
    trace: _Trace, index: int, time: float, marks: Marks, noise: float
) -> Iterator[_Trace]:
    """Yield the ways to go on with a pulse: it is double, or that of one of the next marks."""
    since, place = trace.recent[-1]
    due = _expected_speed(trace.recent, time, noise) * (time - since)
    following, gap = trace.number + 1, _GAP + noise / 2
    lowest, highest = marks.near(place + 0.65 * due), marks.near(place + 1.5 * due)
    numbers = {following}
    if highest > following:
        step = 1 + (highest - lowest) // 8
        numbers |= {*range(max(lowest, following), highest + 1, step), marks.near(place + due)}
    for number in numbers:
        reached = marks.place(number)
        change = abs(log((reached - place) / due))
        is_next = number == following
        yield _Trace(
            trace.cost + change + (0 if is_next else gap + 0.03 * (number - following)),
            number,
            trace.n_plain + 1 if is_next and change < 0.2 else 0,
            (*trace.recent[-4:], (time, reached)),
            (index, number, trace.path),
            trace.margin,
        )
    yield trace._replace(cost=trace.cost + _DOUBLE, n_plain=0)


def _expected_speed(recent: tuple[tuple[float, float], ...], time: float, noise: float) -> float:
    """Return the speed from the last pulse to a time: held, or going on to change as before."""
    (first, start), (third, low), (second, middle), (last, high) = recent[0], *recent[-3:]
    held = (high - start) / (last - first)
    speed, before = (high - middle) / (last - second), (middle - low) / (second - third)
    slope = (speed - before) / (last - third)
    ahead = min(max(speed + slope * (time - second), speed / 1.5), 1.5 * speed)
    change = (speed - before) / speed
    weight = change**2 / (change**2 + 4 * noise**2) if change else 0.0
    return held + weight * (ahead - held)


def _plain(times: Array, marks: Marks, index: int, number: int) -> tuple[float, int]:
    """Return the cost and the number of pulses that follow with a constant speed."""
    times = times[index - 4 : index + 500]
    places = marks.places(np.arange(number - 4, number - 4 + len(times)))
    speed = np.diff(places) / np.diff(times)
    held = (places[4:] - places[:-4]) / (times[4:] - times[:-4])
    change = np.abs(np.log(speed[4:] / held[:-1]))
    n_plain = int(np.argmax(np.append(change, inf) > 0.2))
    return float(change[:n_plain].sum()), n_plain


def _shape(times: Array, numbered: NumberedPulses, n_marks: int) -> Array:
    """Return the logarithms of the intervals of one revolution: medians over all revolutions."""
    number = numbered.number
    every = np.arange(number[0], number[-1] + 1)
    passed = np.interp(numbered.marks.places(every), numbered.places, times[numbered.kept])
    intervals = np.diff(passed)
    ratio = intervals / uniform_filter1d(intervals, n_marks, mode="nearest")
    is_there = np.isin(every, number)
    valid = is_there[1:] & is_there[:-1]
    medians = pd.Series(ratio[valid]).groupby(every[:-1][valid] % n_marks).median()
    return np.log(medians.reindex(range(n_marks), fill_value=1.0).to_numpy())


def _uneven(shape: Array) -> Marks:
    """Return the places of marks whose intervals have these logarithms.

    What varies slowly from mark to mark is not the spacing, but a speed that varies within the
    revolution, up to one harmonic for ten marks; nor are deviations of less than 5 %.
    """
    n_marks = len(shape)
    phase = 2 * np.pi * np.outer(np.arange(n_marks), np.arange(n_marks // 10 + 1)) / n_marks
    waves = np.hstack([np.cos(phase), np.sin(phase[:, 1:])])
    rest = shape
    for _ in range(20):  # least absolute deviations, by weights
        weight = 1 / np.sqrt(np.maximum(np.abs(rest), 1e-3))
        course = np.linalg.lstsq(waves * weight[:, np.newaxis], shape * weight, rcond=None)[0]
        rest = shape - waves @ course
    if np.abs(rest).max() < 0.05:
        return Marks()
    widths = np.exp(np.where(np.abs(rest) < 0.05, 0, rest))
    within = np.concatenate([[0], np.cumsum(widths)[:-1]]) * (n_marks / widths.sum())
    return Marks(tuple(within.tolist()))
