"""Residual signals: recordings less the time-synchronous average of healthy ones."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.validation import check_is_fitted

from emacm._checks import located
from emacm.conditions.healthy import ConditionBaseline, check_healthy_rates
from emacm.recordings.digests import content_digest
from emacm.recordings.inputs import as_recordings, check_channels
from emacm.recordings.meta import condition_name
from emacm.recordings.recording import Recording
from emacm.resampling.angle_recording import (
    AngleRecording,
    AngleStroke,
    as_angle_recordings,
    check_alike,
)


class GridSignals(NamedTuple):
    """Signals at consecutive grid angles along the motion; the first angle has number `first`."""

    first: int
    signals: NDArray[np.floating]

    @property
    def stop(self) -> int:
        """Number of the last grid angle, plus 1."""
        return self.first + self.signals.shape[-1]


def mean_sections(recordings: Sequence[Sequence[GridSignals]]) -> tuple[GridSignals, ...]:
    """Average strokes at each grid angle that at least half of the recordings contain.

    Parameters
    ----------
    recordings : sequence of sequence of GridSignals, each of shape (n_channels, n_angles)
        The strokes of each recording, on a common grid.

    Returns
    -------
    tuple of GridSignals
        Means over all strokes, float64, in ascending order.

    Examples
    --------
    >>> one, two = GridSignals(0, np.array([[1.0, 2, 3]])), GridSignals(1, np.array([[4.0, 5, 6]]))
    >>> (mean,) = mean_sections([[one], [two]])
    >>> mean.first, mean.signals.tolist()
    (0, [[1.0, 3.0, 4.0, 6.0]])
    """
    strokes = [stroke for strokes in recordings for stroke in strokes]
    first, stop = min(s.first for s in strokes), max(s.stop for s in strokes)
    total = np.zeros((len(strokes[0].signals), stop - first))
    counts, visits = np.zeros(stop - first), np.zeros(stop - first)
    for of_one in recordings:
        visited = np.zeros(stop - first, dtype=bool)
        for stroke in of_one:
            grid = slice(stroke.first - first, stroke.stop - first)
            total[:, grid] += stroke.signals
            counts[grid] += 1
            visited[grid] = True
        visits += visited
    known = np.flatnonzero(visits >= 0.5 * len(recordings))
    parts = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1)
    return tuple(GridSignals(first + int(p[0]), total[:, p] / counts[p]) for p in parts if len(p))


@dataclass(frozen=True, repr=False)
class AngleBaseline:
    """Mean signals of a healthy machine at each shaft angle (time-synchronous average).

    Attributes
    ----------
    theta_s : float
        Distance of the grid angles [rad].
    sections : mapping of {1, -1, 0} to tuple of GridSignals
        Mean signals of each direction, counted along the motion.
    name : str
        Condition of the recordings.
    digest : str
        SHA-256 of `theta_s` and `sections`; baselines with equal digests are equal.
    """

    theta_s: float = field(compare=False)
    sections: Mapping[int, tuple[GridSignals, ...]] = field(compare=False)
    name: str = field(default="", compare=False)
    digest: str = field(init=False)

    def __post_init__(self) -> None:
        """Compute the digest at once, so that joblib gives equal baselines equal hashes."""
        ways = sorted(self.sections.items())
        facts = [(way, [part.first for part in parts]) for way, parts in ways]
        arrays = [part.signals for _, parts in ways for part in parts]
        digest = content_digest(repr((self.theta_s, facts)), arrays)
        object.__setattr__(self, "digest", digest)

    def __repr__(self) -> str:
        """Return name and digest; cached spectra are identified by this text."""
        return f"AngleBaseline({self.name}; {self.digest})"


def mean_baseline(recordings: Sequence[AngleRecording], name: str) -> AngleBaseline:
    """Average recordings at each shaft angle, separately for each direction.

    Parameters
    ----------
    recordings : sequence of AngleRecording
        Recordings with the same theta_s and channels.
    name : str
        Condition of the recordings.

    Returns
    -------
    AngleBaseline
        At angles that at least half of the recordings contain (of those with strokes in
        this direction).
    """
    strokes = [[GridStroke.of(stroke) for stroke in r.strokes] for r in recordings]
    sections = {}
    for direction in sorted({stroke.direction for of_one in strokes for stroke in of_one}):
        signals = [
            [GridSignals(s.first, s.signals) for s in of_one if s.direction == direction]
            for of_one in strokes
        ]
        sections[direction] = mean_sections([of_one for of_one in signals if of_one])
    return AngleBaseline(recordings[0].theta_s, sections, name)


@dataclass(frozen=True)
class GridStroke(AngleStroke):
    """A stroke, or a section of one, resampled at whole multiples of theta_s.

    Attributes
    ----------
    skipped : int
        Samples of the path before the first sample.
    count : int
        Number of samples.
    first : int
        Number of the first grid angle, counted along the motion.
    baseline : ndarray of shape (n_channels, count) or None
        Signals to subtract.
    """

    skipped: int
    count: int
    first: int
    baseline: NDArray[np.floating] | None = field(default=None, repr=False, compare=False)

    @classmethod
    def of(cls, stroke: AngleStroke) -> GridStroke:
        """Align a stroke: its samples are at whole multiples of theta_s."""
        theta_s, path, skipped = stroke.parent.theta_s, stroke.path, 0
        position = path.direction * path.start_angle / theta_s
        first = int(np.floor(position + 1e-9))  # of the grid, counted along the motion
        ahead = (position - first) * theta_s
        if ahead > 1e-9 * theta_s:  # the path starts there, which is before the stroke
            path, skipped = path.starting_before(ahead), 1
        count = path.count(theta_s) - skipped
        return cls(stroke.parent, path, skipped, count, first + skipped)

    def section(self, low: int, high: int, baseline: NDArray[np.floating]) -> GridStroke:
        """Return grid angles `low` to `high` (exclusive) of the stroke, less a baseline."""
        skipped = self.skipped + low - self.first
        return replace(self, skipped=skipped, count=high - low, first=low, baseline=baseline)

    @property
    def start_angle(self) -> float:
        """Shaft angle of the first sample [rad]."""
        return self.path.start_angle + self.path.direction * self.parent.theta_s * self.skipped

    @property
    def n_angles(self) -> int:
        """Number of samples over the angle."""
        return self.count

    @property
    def revolutions(self) -> float:
        """Length of the stroke [revolutions]."""
        return (self.count - 1) * self.parent.theta_s / (2 * np.pi)

    def blocks(self, rows: Sequence[int]) -> Iterator[NDArray[np.floating]]:
        """Resample some channels block by block, less their baseline.

        Parameters
        ----------
        rows : sequence of int
            Numbers of channels.

        Yields
        ------
        ndarray of shape (n_rows, n_angles)
            Consecutive blocks.
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
class ResidualRecording(AngleRecording):
    """Residual of a recording: its signals less the mean of a healthy machine at each angle.

    Like any `AngleRecording`, it is evaluated when its signals are read. Its strokes are cut
    to the angles of the baseline.

    Attributes
    ----------
    baseline : AngleBaseline
        Mean signals that are subtracted.
    """

    baseline: AngleBaseline = field(kw_only=True)

    @property
    def strokes(self) -> tuple[AngleStroke, ...]:
        """The strokes, or sections of them, that have a baseline, in order of time."""
        sections = tuple(
            aligned.section(low, high, known.signals[:, low - known.first : high - known.first])
            for stroke in super().strokes
            for aligned in [GridStroke.of(stroke)]
            for known in self.baseline.sections.get(stroke.direction, ())
            for low in [max(aligned.first, known.first)]
            for high in [min(aligned.first + aligned.count, known.stop)]
            if high - low > 1
        )
        if not sections:
            starts = [f"{stroke.start_angle:.4g}" for stroke in super().strokes[:4]]
            raise ValueError(
                f"no stroke of it, which start at {', '.join(starts)} rad, is within the shaft "
                f"angles of the healthy recordings of {self.baseline.name}."
            )
        return sections


class SignalBaseline(ConditionBaseline, auto_wrap_output_keys=None):  # type: ignore[call-arg]
    """Subtract the mean healthy signal at each shaft angle, for each condition.

    Load, speed and the individual unit change the signals more than an incipient fault does. The
    mean over healthy recordings of the same condition is the time-synchronous average [1]_, here
    over whole strokes and for each direction; the difference is the *residual signal*. It
    follows `OrderResampler` in a pipeline; `OrderPSD` and the stroke features take its output.

    Parameters
    ----------
    condition : hashable, tuple or callable, default="load"
        Key of the recordings' `meta` ("load", "unit"), a tuple of keys, or a function of the
        recording.
    healthy : label, or collection of labels, default="healthy"
        Healthy recordings: those with these labels in `y`.
    baseline_recordings : list of Recording or AngleRecording, optional
        Further healthy recordings, for example of commissioning, used in addition to those in
        X. A condition without healthy recordings in X gets its baseline from them. Recordings
        over time are resampled as X is.

    Attributes
    ----------
    conditions_ : tuple
        Conditions with healthy recordings, sorted if they have an order.
    baselines_ : dict of condition to AngleBaseline
        The means that are subtracted.
    channels_ : tuple of str
        Channels.
    theta_s_ : float
        Angle between samples [rad].

    See Also
    --------
    emacm.FeatureBaseline : The same for features.
    emacm.ConditionRouter : A model for each condition.

    Notes
    -----
    The signals are resampled at whole multiples of `theta_s`, so means and differences are
    computed sample by sample, without interpolation. A mean exists where at least half of the
    healthy recordings have samples (assumed); strokes are cut to this range. Short strokes of a
    shaft that vibrates at rest would enter the mean: set `min_speed` of `OrderResampler` above
    this motion. Healthy recordings used in training are
    part of their own mean: their residual is smaller than that of new ones, by the factor
    1 - 1/n_healthy.

    References
    ----------
    .. [1] P. D. McFadden, "A revised model for the extraction of periodic waveforms by time
       domain averaging", Mechanical Systems and Signal Processing 1 (1), 1987.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import OrderResampler, Recording, SignalBaseline
    >>> angle = np.linspace(0, 100, 5001)
    >>> runs = [
    ...     Recording({"current": level + np.sin(angle)}, 100, angle=angle, meta={"load": 20})
    ...     for level in (1.0, 1.5)
    ... ]
    >>> rows = OrderResampler(0.1).fit_transform(runs)
    >>> residual = SignalBaseline().fit_transform(rows, ["healthy", "worn"])
    >>> float(residual[1].strokes[0].signals.mean().round(3))
    0.5
    """

    def fit(self, X: Any, y: ArrayLike | None = None) -> SignalBaseline:
        """Average the healthy recordings of each condition.

        Parameters
        ----------
        X : list of AngleRecording
            Recordings, as `OrderResampler` returns them.
        y : array-like of shape (n_recordings,)
            Labels.

        Returns
        -------
        SignalBaseline
            Itself.

        Raises
        ------
        TypeError, ValueError
            If X or a parameter is invalid, `healthy` is not in y, a condition has no healthy
            recording, or channels, `theta_s` or sampling rates differ; the message gives the
            recording or the condition.
        """
        rows = as_angle_recordings(X, "SignalBaseline")
        found = self._find_healthy(rows, y)
        first = rows[0]
        self._check_alike(rows, first.channels, first.theta_s)
        with located("baseline_recordings"):
            further = _resampled_as(first, found.further)
            self._check_alike(further, first.channels, first.theta_s)
        healthy = [rows[row] for row in np.flatnonzero(found.mask)] + further
        self.baselines_ = {}
        for value, own in found.rows.items():
            name = condition_name(self.condition, value)
            self.baselines_[value] = mean_baseline([healthy[row] for row in own], name)
        self._rates, self.conditions_ = found.rates, tuple(self.baselines_)
        self.channels_, self.theta_s_ = first.channels, first.theta_s
        return self

    def transform(self, X: Any) -> list[ResidualRecording]:
        """Subtract the baseline of each recording's condition.

        Parameters
        ----------
        X : list of AngleRecording
            Recordings.

        Returns
        -------
        list of ResidualRecording
            Recordings over the shaft angle, evaluated when their signals are read.

        Raises
        ------
        TypeError, ValueError
            If X is invalid, a recording's condition has no baseline, or its channels, `theta_s`
            or sampling rates differ from those of `fit`; the message gives the recording.
        """
        check_is_fitted(self)
        rows = as_angle_recordings(X, "SignalBaseline")
        self._check_alike(rows, self.channels_, self.theta_s_)
        check_healthy_rates(rows, self._rates)
        found = self._known_conditions(rows)
        return [
            ResidualRecording(**vars(row), baseline=self.baselines_[condition])
            for row, condition in zip(rows, found, strict=True)
        ]

    def _check_alike(
        self, rows: Sequence[AngleRecording], channels: Sequence[str], theta_s: float
    ) -> None:
        """Raise if recordings differ from those of `fit`, or cannot have a baseline."""
        check_alike(rows, channels, theta_s, "SignalBaseline")
        if any(row.direction == "travel" or isinstance(row, ResidualRecording) for row in rows):
            raise ValueError(
                "SignalBaseline needs strokes of one direction each, which direction='travel' of "
                "OrderResampler joins, and no residuals. Use direction='strokes', and one only."
            )


def _resampled_as(first: AngleRecording, recordings: list[Any]) -> list[AngleRecording]:
    """Return recordings over the shaft angle, resampled with the settings of another one."""
    if not recordings:
        return []
    rows = as_recordings(recordings, "SignalBaseline", also=(AngleRecording,))
    check_channels(rows, first.channels)
    return [replace(first, measured=row) if isinstance(row, Recording) else row for row in rows]
