"""Base class of the estimators that compute named feature columns from strokes.

A column is named ``channel+:feature`` for forward strokes, ``channel-:feature`` for reverse ones,
``channel:feature`` for both together. Orders and bins have other names, ``channel@...``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_choice, check_number, located
from emacm._statements import Statement
from emacm.findings.quality import forward_share
from emacm.findings.training_range import Range, direction_statements
from emacm.orders.columns import NamedColumns
from emacm.recordings.inputs import as_recordings, check_channels, chosen_channels, for_each
from emacm.recordings.recording import Recording
from emacm.resampling.angle_recording import AngleRecording
from emacm.shaft.motion import ShaftPath

Samples = NDArray[np.floating]


class StrokeSignal(NamedTuple):
    """One channel in one stroke.

    Attributes
    ----------
    signal : ndarray of shape (n_samples,)
        Samples.
    travel : ndarray of shape (n_samples,)
        Angle travelled since the start of the stroke, at each sample [rad].
    start_angle : float
        Shaft angle at the start of the stroke [rad].
    direction : {1, -1, 0}
        Forward, reverse, or 0 where both were joined ("travel").
    """

    signal: Samples
    travel: Samples
    start_angle: float
    direction: int

    @property
    def angle(self) -> Samples:
        """Shaft angle at each sample [rad]."""
        return self.start_angle + (self.direction or 1) * self.travel

    def cut(self, samples: slice) -> StrokeSignal:
        """Return some of the samples, at unchanged angles."""
        return self._replace(signal=self.signal[samples], travel=self.travel[samples])


Row = Recording | AngleRecording

WAYS = {"+": (1, "forward"), "-": (-1, "reverse")}


class StrokeFeatures(NamedColumns):
    """Base class of the transformers from recordings to named feature columns.

    Subclasses have these and other parameters, and implement `_check_own_parameters`,
    `_feature_names` and `_features`.
    """

    by_direction_: bool
    _needs_angle = False  # whether the features need the angle of the shaft, not only its travel
    _known_forward: Range | None

    def __init__(
        self,
        channels: Sequence[str] | None,
        by_direction: bool | str,
        min_speed: float,
        min_revolutions: float,
        n_jobs: int | None,
    ) -> None:
        self.channels = channels
        self.by_direction = by_direction
        self.min_speed = min_speed
        self.min_revolutions = min_revolutions
        self.n_jobs = n_jobs

    def fit(self, X: Any, y: Any = None) -> Self:
        """Set the channels and the names of the columns; no feature is computed.

        Parameters
        ----------
        X : list of Recording, or output of OrderResampler
            Recordings.
        y : ignored

        Returns
        -------
        StrokeFeatures
            Itself.

        Raises
        ------
        TypeError, ValueError
            If a parameter or X is invalid.
        """
        self._check_parameters()
        rows = as_recordings(X, type(self).__name__, also=(AngleRecording,))
        self.channels_ = chosen_channels(self.channels, rows[0].channels)
        self._over_angle = isinstance(rows[0], AngleRecording)
        self.by_direction_ = self._separates_directions(rows)
        self._known_forward = None
        if not (self.by_direction_ or self._over_angle):
            shares = [forward_share(self._strokes(row)) for row in rows]
            self._known_forward = min(shares), max(shares)
        self._check_rows(rows)
        signs = WAYS if self.by_direction_ else ("",)
        self._names_in, self._n_in = None, len(self.channels_)
        self._columns_out = tuple(
            f"{channel}{sign}:{name}"
            for channel in self.channels_
            for sign in signs
            for name in self._feature_names()
        )
        return self

    def transform(self, X: Any) -> NDArray[np.float64]:
        """Compute the columns, one recording at a time.

        Parameters
        ----------
        X : list of Recording, or output of OrderResampler
            Recordings of the same kind and with the same channels as in `fit`.

        Returns
        -------
        ndarray of shape (n_recordings, n_columns)
            Channel by channel; the names are those of `get_feature_names_out`.

        Raises
        ------
        TypeError, ValueError
            If X is invalid, or a recording has no stroke for a column; the message gives the
            recording, the channel and the direction.
        """
        check_is_fitted(self)
        rows = as_recordings(X, type(self).__name__, also=(AngleRecording,))
        self._check_rows(rows)
        features = for_each(self._row, rows, self.n_jobs)
        return self._checked_table(np.array(features, dtype=np.float64))

    def outside_training(self, X: Any) -> list[list[Statement]]:
        """State in which directions recordings turn, but none of `fit`.

        Parameters
        ----------
        X : list of Recording, or output of OrderResampler
            Recordings; nothing is stated of those over the shaft angle, as `OrderResampler` does.

        Returns
        -------
        list of list of Statement
            For each recording.
        """
        check_is_fitted(self)
        if (known := self._known_forward) is None:
            return [[] for _ in X]
        return [direction_statements(forward_share(self._strokes(row)), known) for row in X]

    def __sklearn_tags__(self) -> Any:
        """Declare that X is a list of recordings, not a 2-D table."""
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        tags.input_tags.three_d_array = True
        return tags

    def _check_own_parameters(self) -> None:
        """Raise if a parameter of the subclass is invalid."""

    def _feature_names(self) -> list[str]:
        """Return the column names without the channel, for strokes of one direction."""
        raise NotImplementedError

    def _features(self, strokes: Sequence[StrokeSignal]) -> Any:
        """Return the values of `_feature_names` for the strokes of one channel and direction."""
        raise NotImplementedError

    def _checked_table(self, table: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the features of all recordings from the results of `_row`."""
        return table

    def _check_parameters(self) -> None:
        check_choice(self.by_direction, "by_direction", (True, False, "auto"))
        check_number(self.min_speed, "min_speed", at_least=0, unit="rad/s")
        check_number(self.min_revolutions, "min_revolutions", at_least=0)
        self._check_own_parameters()

    def _strokes(self, row: Row) -> list[Any]:
        """Return the strokes that are not too short; over time, the paths of the shaft."""
        if isinstance(row, AngleRecording):
            return [s for s in row.strokes if s.revolutions >= self.min_revolutions]
        shortest = 2 * np.pi * self.min_revolutions
        return [path for path in row.paths(min_speed=self.min_speed) if path.length >= shortest]

    def _separates_directions(self, rows: Sequence[Row]) -> bool:
        """Return whether directions are separate; "auto": if a recording has strokes of both."""
        if self.by_direction != "auto":
            return bool(self.by_direction)
        return any({1, -1} <= {stroke.direction for stroke in self._strokes(row)} for row in rows)

    def _check_rows(self, rows: Sequence[Row]) -> None:
        """Raise if recordings differ from those of `fit`."""
        check_channels(rows, self.channels_, others=self.channels is not None)
        for_each(self._check_row, rows)

    def _check_row(self, row: Row) -> None:
        """Raise if a recording does not match those of `fit`, or the parameters."""
        if isinstance(row, AngleRecording) != self._over_angle:
            kinds = ("over time", "over the shaft angle")
            raise ValueError(
                f"it is {kinds[not self._over_angle]}, but {type(self).__name__} was fitted on "
                f"recordings {kinds[self._over_angle]}. Fit it again."
            )
        if not isinstance(row, AngleRecording):
            return
        if row.direction == "travel" and (self.by_direction_ or self._needs_angle):
            raise ValueError(
                "it was resampled with direction='travel', which has no shaft angle and joins both "
                "directions. Use direction='strokes'."
            )
        if self.min_speed not in (0, row.min_speed):
            raise ValueError(
                f"min_speed = {self.min_speed:g} contradicts OrderResampler, which found the "
                f"strokes with {row.min_speed:g}. Set it there only."
            )

    def _row(self, row: Row) -> NDArray[np.float64]:
        blocks = []
        channels = _cut_into_strokes(row, self.channels_, self._strokes(row))
        for channel, strokes in zip(self.channels_, channels, strict=True):
            for sign, way in WAYS.values() if self.by_direction_ else [(0, "")]:
                kind = f"{way} stroke".strip()
                chosen = [stroke for stroke in strokes if sign in (0, stroke.direction)]
                if not chosen:
                    raise ValueError(
                        f"it has no {kind} of two samples and {self.min_revolutions:g} "
                        f"revolutions. Leave it out, check min_speed, ratio, min_revolutions and "
                        f"the shaft reference, or use by_direction=False."
                    )
                with located(f"channel {channel!r}, {kind}s"):
                    blocks.append(self._features(chosen))
        return np.concatenate(blocks).astype(np.float64)


def _cut_into_strokes(
    row: Row, channels: Sequence[str], strokes: Sequence[Any]
) -> list[list[StrokeSignal]]:
    """Return the signals of each channel in the strokes of a recording.

    Over time, samples are cut at the ends of strokes, without resampling; over the shaft angle,
    the strokes are resampled in this call.
    """
    cuts: list[list[StrokeSignal]] = [[] for _ in channels]
    if isinstance(row, AngleRecording):
        for stroke in strokes:
            signals, travel = stroke.signals, row.theta_s * np.arange(stroke.n_angles)
            for name, cut in zip(channels, cuts, strict=True):
                signal = signals[row.channels.index(name)]
                cut.append(StrokeSignal(signal, travel, stroke.start_angle, stroke.direction))
        return cuts
    for name, cut in zip(channels, cuts, strict=True):
        signal, fs = row.signals[name], row.fs[name]  # read once, also from a file
        cut += [_of_path(path, signal, fs) for path in strokes]
    return cuts


def _of_path(path: ShaftPath, signal: Samples, fs: float) -> StrokeSignal:
    first, last = path.sample_range(fs, len(signal))
    travel = path.travel_at(fs, first, last)
    return StrokeSignal(signal[first:last], travel, path.start_angle, path.direction)
