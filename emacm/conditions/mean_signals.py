"""Mean healthy signals over the shaft angle, and recordings less these.

Signals that a motion repeats (friction along the stroke, the profile's accelerations, ripple of
the motor) stand at the same shaft angles each time. Averaging over repeats keeps them and
lets go of the rest, which is time-synchronous averaging; here over whole strokes.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm.recordings.digests import content_digest
from emacm.resampling.angle_recording import AngleRecording, AngleStroke
from emacm.shaft.paths import ShaftPath, StrokeTravel

ALIGNMENTS = ("angle", "start")
REACHED = 0.5  # share of the recordings that must reach an angle for a mean there; assumed
_ON_GRID = 1e-9  # of theta_s: closer to a grid angle than this is there


class Stretch(NamedTuple):
    """A signal over consecutive places along the motion; the first has number `first`."""

    first: int
    signals: NDArray[np.floating]

    @property
    def stop(self) -> int:
        """Number of the last place, plus 1."""
        return self.first + self.signals.shape[-1]


def mean_stretches(
    recordings: Sequence[Sequence[Stretch]], *, reached: float = REACHED
) -> tuple[Stretch, ...]:
    """Average over strokes, place by place, where enough recordings have been.

    Parameters
    ----------
    recordings : sequence of sequence of Stretch, each of shape (n_channels, n_places)
        The strokes of each recording, on common places.
    reached : float
        Share of the recordings that must have been at a place.

    Returns
    -------
    tuple of Stretch
        Means over all strokes, float64, in order; empty if there is no stroke.

    Examples
    --------
    >>> one, two = Stretch(0, np.array([[1.0, 2, 3]])), Stretch(1, np.array([[4.0, 5, 6]]))
    >>> (mean,) = mean_stretches([[one], [two]], reached=1)
    >>> mean.first, mean.signals.tolist()
    (1, [[3.0, 4.0]])
    """
    strokes = [stroke for strokes in recordings for stroke in strokes]
    if not strokes:
        return ()
    first, stop = min(s.first for s in strokes), max(s.stop for s in strokes)
    total = np.zeros((len(strokes[0].signals), stop - first))
    counts, visits = np.zeros(stop - first), np.zeros(stop - first)
    for own in recordings:
        visited = np.zeros(stop - first, dtype=bool)
        for stroke in own:
            place = slice(stroke.first - first, stroke.stop - first)
            total[:, place] += stroke.signals
            counts[place] += 1
            visited[place] = True
        visits += visited
    known = (visits > 0) & (visits >= reached * len(recordings))
    return tuple(
        Stretch(first + low, total[:, low:high] / counts[low:high]) for low, high in _runs(known)
    )


@dataclass(frozen=True, repr=False)
class AngleBaseline:
    """What the channels are at each shaft angle in a healthy machine, by direction.

    Attributes
    ----------
    theta_s : float
        Distance of the places [rad].
    align : {"angle", "start"}
        Whether places are counted from shaft angle 0, or from the start of a stroke.
    stretches : mapping of {1, -1, 0} to tuple of Stretch
        Mean signals of each direction, over places counted along the motion.
    name : str
        Condition that it is of.
    digest : str
        SHA-256 of all the rest; baselines are equal if it is.
    """

    theta_s: float = field(compare=False)
    align: str = field(compare=False)
    stretches: Mapping[int, tuple[Stretch, ...]] = field(compare=False)
    name: str = field(default="", compare=False)
    digest: str = field(init=False)

    def __post_init__(self) -> None:
        """Work out the digest at once, so that equal baselines look alike to joblib."""
        ways = sorted(self.stretches.items())
        facts = [(way, [part.first for part in parts]) for way, parts in ways]
        arrays = [part.signals for _, parts in ways for part in parts]
        digest = content_digest(repr((self.theta_s, self.align, facts)), arrays)
        object.__setattr__(self, "digest", digest)

    def __repr__(self) -> str:
        """Name and digest: by this text spectra that are kept are told apart."""
        return f"AngleBaseline({self.name}; {self.digest})"

    def reach(self, direction: int) -> tuple[tuple[float, float], ...]:
        """Shaft angles from and to which means are known [rad], along the motion."""
        sign = direction or 1
        return tuple(
            (sign * part.first * self.theta_s, sign * (part.stop - 1) * self.theta_s)
            for part in self.stretches.get(direction, ())
        )


def mean_baseline(
    recordings: Sequence[AngleRecording], *, align: str = "angle", name: str = ""
) -> AngleBaseline:
    """Average recordings over the shaft angle, each direction by itself.

    Parameters
    ----------
    recordings : sequence of AngleRecording
        Of one theta_s and with the same channels.
    align : {"angle", "start"}
        Put strokes together by their shaft angle, or by the angle run since they began.
    name : str
        Condition that they were made under.

    Returns
    -------
    AngleBaseline
        Known where half of the recordings have been at least (of those with strokes in
        this direction).
    """
    found: dict[int, list[list[Stretch]]] = {}
    for recording in recordings:
        own: dict[int, list[Stretch]] = {}
        for stroke in recording.strokes:
            placed = PlacedStroke.of(stroke, align)
            own.setdefault(stroke.direction, []).append(Stretch(placed.place, placed.signals))
        for direction, strokes in own.items():
            found.setdefault(direction, []).append(strokes)
    stretches = {direction: mean_stretches(found[direction]) for direction in sorted(found)}
    return AngleBaseline(recordings[0].theta_s, align, stretches, name)


@dataclass(frozen=True)
class PlacedStroke(AngleStroke):
    """A stroke, or part of one, whose samples lie at common places.

    Attributes
    ----------
    skipped : int
        Samples of the path that come before the first.
    count : int
        Samples.
    place : int
        Number of the first place, counted along the motion.
    baseline : ndarray of shape (n_channels, count) or None
        What is subtracted.
    """

    skipped: int
    count: int
    place: int
    baseline: NDArray[np.floating] | None = field(default=None, repr=False, compare=False)

    @classmethod
    def of(cls, stroke: AngleStroke, align: str) -> PlacedStroke:
        """Place a stroke; by "angle", it is sampled at whole multiples of theta_s."""
        theta_s = stroke.parent.theta_s
        if align == "start":
            return cls(stroke.parent, stroke.path, 0, stroke.n_angles, 0)
        path, first, skipped = _on_grid(stroke.path, theta_s)
        count = path.count(theta_s) - skipped
        return cls(stroke.parent, path, skipped, count, first + skipped)

    def part(self, low: int, high: int, baseline: NDArray[np.floating]) -> PlacedStroke:
        """Return places `low` to `high` (exclusive) of the stroke, less a baseline."""
        skipped = self.skipped + low - self.place
        return replace(self, skipped=skipped, count=high - low, place=low, baseline=baseline)

    @property
    def start_angle(self) -> float:
        """Shaft angle of the first sample [rad]."""
        sign = self.path.direction or 1
        return self.path.start_angle + sign * self.parent.theta_s * self.skipped

    @property
    def n_angles(self) -> int:
        """Number of samples over the angle."""
        return self.count

    @property
    def revolutions(self) -> float:
        """Length of the stroke [revolutions]."""
        return (self.count - 1) * self.parent.theta_s / (2 * np.pi)

    def blocks(self, rows: Sequence[int]) -> Iterator[NDArray[np.floating]]:
        """Resample some channels a block at a time, less their baseline.

        Parameters
        ----------
        rows : sequence of int
            Numbers of channels that were sampled at one rate.

        Yields
        ------
        ndarray of shape (n_rows, n_angles)
            Blocks that continue one another.
        """
        done = -self.skipped
        for block in super().blocks(rows):
            low, high = max(done, 0), min(done + block.shape[1], self.count)
            if low < high:
                piece = block[:, low - done : high - done]
                if self.baseline is not None:
                    piece = (piece - self.baseline[list(rows), low:high]).astype(block.dtype)
                yield piece
            done += block.shape[1]
            if done >= self.count:
                return


@dataclass(frozen=True)
class NormalizedRecording(AngleRecording):
    """A recording over the shaft angle, less what a healthy machine shows at each angle.

    Like any `AngleRecording`, it is evaluated when its signals are read. Its strokes are cut
    to where the baseline is known.

    Attributes
    ----------
    baseline : AngleBaseline
        What is subtracted.
    """

    baseline: AngleBaseline = field(kw_only=True)

    @classmethod
    def of(cls, recording: AngleRecording, baseline: AngleBaseline) -> NormalizedRecording:
        """Subtract a baseline from a recording that was resampled with the same theta_s."""
        names = AngleRecording.__dataclass_fields__
        return cls(**{name: getattr(recording, name) for name in names}, baseline=baseline)

    @property
    def strokes(self) -> tuple[AngleStroke, ...]:
        """The strokes, or parts of them, for which there is a baseline, in order of time."""
        parts = tuple(
            placed.part(low, high, known.signals[:, low - known.first : high - known.first])
            for stroke in super().strokes
            for placed in [PlacedStroke.of(stroke, self.baseline.align)]
            for known in self.baseline.stretches.get(stroke.direction, ())
            for low, high in [_common(placed, known)]
            if high - low > 1
        )
        if not parts:
            raise ValueError(self._nowhere())
        return parts

    def coverage(self) -> tuple[float, float]:
        """Return the revolutions of all strokes, and of those parts that have a baseline."""
        whole = sum(stroke.revolutions for stroke in super().strokes)
        try:
            return whole, sum(stroke.revolutions for stroke in self.strokes)
        except ValueError:
            return whole, 0.0

    def _nowhere(self) -> str:
        ways = {1: "forward", -1: "reverse", 0: "travelling"}
        known = [
            f"{way} {low:.4g} to {high:.4g} rad"
            for direction, way in ways.items()
            for low, high in self.baseline.reach(direction)
        ]
        own = [f"{ways[s.direction]} from {s.start_angle:.4g} rad" for s in super().strokes]
        return (
            f"no stroke of it ({', '.join(own[:4])}) runs where healthy recordings of "
            f"{self.baseline.name} have been ({', '.join(known) or 'nowhere'}). Use healthy "
            f"recordings of the same motion, or align='start'."
        )


def _on_grid(path: ShaftPath, theta_s: float) -> tuple[ShaftPath, int, int]:
    """Start a path earlier, by less than theta_s, at a whole multiple of theta_s.

    Returns the path, the number of that multiple along the motion, and how many samples
    lie before the old start.
    """
    sign = path.direction
    position = sign * path.start_angle / theta_s
    first = int(np.floor(position + _ON_GRID))
    ahead = (position - first) * theta_s
    if ahead <= _ON_GRID * theta_s:
        return path, first, 0
    travel: Any = path.travel
    if not isinstance(travel, StrokeTravel):
        raise TypeError(f"only single strokes have places by angle, got {type(travel).__name__}.")
    moved = copy.copy(travel)
    moved.start_angle = path.start_angle - sign * ahead
    return replace(path, travel=moved, start_angle=moved.start_angle), first, 1


def _common(placed: PlacedStroke, known: Stretch) -> tuple[int, int]:
    return max(placed.place, known.first), min(placed.place + placed.count, known.stop)


def _runs(known: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first and last + 1 of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(np.int8)))
    return [(int(low), int(high)) for low, high in edges.reshape(-1, 2)]
