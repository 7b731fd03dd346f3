"""The first step of a pipeline: recordings, from time to shaft angle."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from emacm._checks import (
    check_choice,
    check_number,
    check_real_array,
    check_unique_columns,
    located,
)
from emacm._statements import Statement
from emacm.findings.quality import jump_statement, recording_quality
from emacm.findings.training_range import TrainingRange
from emacm.recordings.inputs import (
    RecordingTransformer,
    as_list,
    check_channel_names,
    check_channels,
    chosen_channels,
    for_each,
    received,
    run,
)
from emacm.recordings.recording import Recording
from emacm.resampling.angle_recording import INTERPOLATIONS, AngleRecording
from emacm.shaft.motion import DIRECTIONS, longest_gap


def check_angle_step(theta_s: Any) -> float:
    """Return the angle between samples.

    Parameters
    ----------
    theta_s : float
        Angle between samples [rad], from 1e-5 to π.

    Returns
    -------
    float

    Raises
    ------
    TypeError, ValueError
        If it is not a number of at least 1e-5 and at most π.
    """
    step = check_number(theta_s, "theta_s", at_least=1e-5, unit="rad per sample")
    if step > np.pi:
        raise ValueError(
            f"theta_s = {step:g} rad is more than half a revolution between two samples. It is the "
            f"angle between samples, not their number: for {step:g} samples per revolution, write "
            f"theta_s=2 * np.pi / {step:g}."
        )
    return step


class OrderResampler(RecordingTransformer, auto_wrap_output_keys=None):  # type: ignore[call-arg]
    """Resample recordings from uniform time to uniform shaft angle.

    This is computed order tracking (COT), or angular resampling. Faults that are synchronous with
    the shaft then appear at fixed orders (cycles per revolution), whatever the speed and the
    direction.

    Parameters
    ----------
    theta_s : float
        Angle between samples of the result [rad], from 1e-5 to π: 2π over the samples per
        revolution. Orders up to π/theta_s exist.
    interpolation : {"cubic", "linear"}
        Used only with ``antialias=False``. "linear" is the thesis, Eq. (2.13).
    antialias : bool
        Band-limited resampling: flat within 0.01 dB up to 0.78 of π/theta_s,
        and no content above is aliased into that range, at any speed.
    direction : {"strokes", "forward", "reverse", "travel"}
        "strokes" resamples each stretch of one direction by itself, along its
        own motion; "forward" and "reverse" keep one kind; "travel" is one path over the integral of
        ``abs(speed)``, where each reversal mirrors the phases.
    min_speed : float
        Speed up to which the measured shaft counts as standing still [rad/s]. Set it above the
        noise of the shaft reference at rest.
    max_rest : float, optional
        Longest time at standstill within a stroke [s]; a longer one ends it. Default: a stroke ends
        only where the direction changes.
    ratio : float
        Revolutions of the shaft of interest per revolution of the measured shaft, such as 13/35
        for the output shaft of a pinion of 13 teeth and a wheel of 35. Angles, revolutions and
        orders of the result are those of the shaft of interest.
    channels : sequence of str, optional
        Channels to keep, in this order. Default: those of the first recording.
    fs : float, optional
        Sampling rate [Hz] of bare arrays and DataFrames.
    reference : int or str, optional
        Channel of bare arrays or DataFrames that holds the motion of the shaft. It is not a channel
        of the result unless `channels` names it.
    reference_kind : {"velocity", "angle"}
        What that channel holds [rad/s or rad].
    n_jobs : int, optional
        Threads for `quality`. Resampling itself happens where the result is
        read, under the reader's ``n_jobs``.

    Attributes
    ----------
    channels_ : tuple of str
        Channels of the result.
    training_range_ : TrainingRange
        Range of revolutions, speeds, highest valid order, conditions, and of sampling rate, unit
        and level of each channel in the recordings of `fit`, and the kinds of their defects; see
        `emacm.outside_training`. It is determined when it is first asked for, or when the
        resampler is saved: until then, the resampler refers to these recordings.

    See Also
    --------
    emacm.OrderPSD : Order spectra of the resampled signals.
    emacm.outside_training : What of a recording is outside the range of training.

    Notes
    -----
    `X` is a list of `Recording`, or, where `fs` and `reference` are given, an
    array of shape (n_recordings, n_channels, n_times), a list of arrays of
    shape (n_channels, n_times), or a list of DataFrames (one row per sample). Bare arrays name
    their channels "x0", "x1" and so on.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import OrderResampler, Recording
    >>> t = np.arange(20_000) / 10_000
    >>> speed = 2 * np.pi * (10 + 5 * np.sin(3 * t))
    >>> angle = np.cumsum(speed) / 10_000
    >>> run = Recording({"vibration": np.sin(8 * angle)}, 10_000, velocity=speed)
    >>> over_angle = OrderResampler(theta_s=2 * np.pi / 64).fit_transform([run])
    >>> stroke = over_angle[0].strokes[0]
    >>> stroke.signals.shape, round(stroke.revolutions, 2)
    ((1, 1285), 20.07)
    """

    def __init__(
        self,
        theta_s: float = 2 * np.pi / 128,
        *,
        interpolation: str = "cubic",
        antialias: bool = True,
        direction: str = "strokes",
        min_speed: float = 0.0,
        max_rest: float | None = None,
        ratio: float = 1.0,
        channels: Sequence[str] | None = None,
        fs: float | None = None,
        reference: int | str | None = None,
        reference_kind: str = "velocity",
        n_jobs: int | None = None,
    ) -> None:
        self.theta_s = theta_s
        self.interpolation = interpolation
        self.antialias = antialias
        self.direction = direction
        self.min_speed = min_speed
        self.max_rest = max_rest
        self.ratio = ratio
        self.channels = channels
        self.fs = fs
        self.reference = reference
        self.reference_kind = reference_kind
        self.n_jobs = n_jobs

    def fit(self, X: Any, y: Any = None) -> OrderResampler:
        """Learn the channels; nothing is resampled.

        Parameters
        ----------
        X : list of Recording, or bare arrays as in the notes above
            Recordings.
        y : ignored

        Returns
        -------
        OrderResampler
            Itself.

        Raises
        ------
        TypeError, ValueError
            If a parameter or a recording is invalid; the message names the recording.
        """
        self._check_parameters()
        rows = self._rows(X)
        self.channels_ = rows[0].channels
        self._trained_on: list[AngleRecording] | None = rows
        return self

    @property
    def training_range_(self) -> TrainingRange:
        """Range of the recordings of `fit`."""
        check_is_fitted(self)
        rows = self._trained_on
        if rows is not None:  # another thread may be here, too
            qualities = run(recording_quality, rows, n_jobs=self.n_jobs)
            self._range = TrainingRange.of(qualities, (row.meta for row in rows))
            self._trained_on = None
        return self._range

    def extend_range(self, X: Any) -> None:
        """Extend the range of the training to recordings that are known to be valid.

        Parameters
        ----------
        X : list of Recording, or bare arrays
            Recordings.
        """
        rows = self._rows(X, self.channels_)
        qualities = run(recording_quality, rows, n_jobs=self.n_jobs)
        further = TrainingRange.of(qualities, (row.meta for row in rows))
        self._range = self.training_range_.joined(further)

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for a copy or a file, which holds no recordings."""
        if getattr(self, "_trained_on", None) is not None:
            self.training_range_  # noqa: B018
        return super().__getstate__()

    def transform(self, X: Any) -> list[AngleRecording]:
        """Return the recordings over the shaft angle, to be resampled when read.

        Parameters
        ----------
        X : list of Recording, or bare arrays
            Recordings with the channels seen in `fit`, in any order.

        Returns
        -------
        list of AngleRecording
            One for each recording. Its ``strokes[i].signals`` are the channels
            at angles `theta_s` apart, its ``frame()`` a labelled table.

        Raises
        ------
        TypeError, ValueError
            If a recording lacks a channel or has others, if its shaft never
            turns (in the wanted direction) faster than `min_speed`, or if its shaft
            reference has an isolated jump or spike of more than half a revolution.

        See Also
        --------
        OrderResampler.quality : Defects of recordings, which `transform` does not look for.
        emacm.outside_training : What of a recording is outside the range of those of `fit`.
        """
        check_is_fitted(self)
        self._check_parameters()
        rows = self._rows(X, self.channels_)
        for_each(self._check_once, rows)
        return rows

    def quality(self, X: Any) -> pd.DataFrame:
        """State revolutions, speed range, highest valid order and defects of each recording.

        Parameters
        ----------
        X : list of Recording, or bare arrays
            Recordings; `fit` is not needed.

        Returns
        -------
        DataFrame
            One row for each recording, with columns

            - ``revolutions`` [rev]: angle travelled in strokes by the shaft of interest,
            - ``strokes`` [number]: strokes,
            - ``longest_stroke`` [rev]: its length,
            - ``standing`` [fraction, 0 to 1]: time at or below `min_speed`,
            - ``slowest``, ``fastest`` [rad/s]: range of its speed in strokes,
            - ``max_order`` [cycles per rev]: highest order that the sampling rates support at
              the highest speed; above it the spectrum contains only images,
            - ``warnings`` [text]: description of the defects of channels (constant, clipped,
              drop-outs, overflow, offset) and of the shaft (jumps, spikes); empty if there are none
        """
        self._check_parameters()
        qualities = run(recording_quality, self._rows(X), n_jobs=self.n_jobs)
        return pd.DataFrame(
            [q.row | {"warnings": "; ".join(d.text for d in q.defects)} for q in qualities]
        )

    def outside_training(self, X: Any) -> list[list[Statement]]:
        """State which properties of recordings are outside the range of those of `fit`.

        Parameters
        ----------
        X : list of Recording, or bare arrays
            Recordings.

        Returns
        -------
        list of list of Statement
            For each recording, see `emacm.findings.training_range.TrainingRange.outside`.
        """
        check_is_fitted(self)
        rows = self._rows(X, self.channels_)
        qualities = run(recording_quality, rows, n_jobs=self.n_jobs)
        pairs = zip(qualities, rows, strict=True)
        return [self.training_range_.outside(quality, row.meta) for quality, row in pairs]

    def over_angle(self, recording: Recording, channels: Sequence[str]) -> AngleRecording:
        """Return channels of one recording over the shaft angle, without any check of it."""
        step, antialias = check_angle_step(self.theta_s), bool(self.antialias)
        motion = self.direction, float(self.min_speed), float(self.ratio), self.max_rest
        return AngleRecording(
            recording, tuple(channels), step, self.interpolation, antialias, *motion
        )

    def _rows(self, X: Any, known: Sequence[str] | None = None) -> list[AngleRecording]:
        """Return recordings over the shaft angle; channels are those of `fit`, or of the first."""
        recordings = self._recordings(X)
        channels = known or chosen_channels(self.channels, recordings[0].channels)
        check_channels(recordings, channels, others=self.channels is not None)
        return [self.over_angle(recording, channels) for recording in recordings]

    def _check_once(self, row: AngleRecording) -> None:
        """Check the motion of a recording, unless it was found right before."""
        motion = "motion", row.direction, row.min_speed, row.max_rest
        row.measured.fact(motion, partial(self._check_motion, row))

    def __sklearn_tags__(self) -> Any:
        """Tell scikit-learn that X may be bare arrays."""
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        return tags

    def _check_parameters(self) -> None:
        check_angle_step(self.theta_s)
        check_choice(self.interpolation, "interpolation", INTERPOLATIONS)
        check_choice(self.antialias, "antialias", (True, False))
        check_choice(self.direction, "direction", tuple(DIRECTIONS))
        check_number(self.min_speed, "min_speed", at_least=0, unit="rad/s")
        longest_gap(self.max_rest, 1.0)
        check_number(self.ratio, "ratio", at_least=1e-6, at_most=1e6)
        check_choice(self.reference_kind, "reference_kind", ("velocity", "angle"))

    def _recordings(self, X: Any) -> list[Recording]:
        """Return X as recordings, whatever form it came in."""
        if isinstance(X, np.ndarray) and X.dtype != object and X.ndim != 3:
            raise ValueError(
                f"an array X must have shape (n_recordings, n_channels, n_times), got {X.shape}."
            )
        return for_each(self._from_bare, as_list(X))

    def _from_bare(self, entry: Any) -> Recording:
        if isinstance(entry, Recording):
            return entry
        if isinstance(entry, AngleRecording):
            raise TypeError("it is over the shaft angle already; OrderResampler must come first.")
        if not isinstance(entry, np.ndarray | pd.DataFrame | list | tuple):
            raise TypeError(f"expected a Recording, an array or a DataFrame, got {received(entry)}")
        if self.fs is None or self.reference is None:
            raise ValueError(
                f"a bare {type(entry).__name__} has neither a sampling rate nor a shaft reference. "
                f"Make a Recording of it, or set fs and reference of OrderResampler."
            )
        channels = _bare_channels(entry)
        names = list(channels)
        reference: Any = self.reference
        if isinstance(reference, int | np.integer) and -len(names) <= reference < len(names):
            reference = names[reference]
        with located("reference"):
            check_channel_names(names, [reference])
        shaft = channels[reference]
        if self.channels is None or reference not in self.channels:
            del channels[reference]
        return Recording(channels, self.fs, **{self.reference_kind: shaft})

    def _check_motion(self, row: AngleRecording) -> None:
        """Check that the shaft turns, and that its reference has no impossible jump."""
        recording = row.measured
        wanted = {"forward": 1, "reverse": -1}.get(self.direction)
        moves = row.paths or recording.strokes(row.min_speed)  # or too short ones only
        if not any(wanted in (None, move.direction) for move in moves):
            way = f" {self.direction}" if wanted else ""
            velocity = recording.velocity
            rpm = 30 / np.pi
            raise ValueError(
                f"the shaft never turns{way} faster than min_speed = {self.min_speed:g} rad/s "
                f"({rpm * self.min_speed:.4g} rpm); its speed is between "
                f"{rpm * velocity.min():.4g} and {rpm * velocity.max():.4g} rpm. Leave the "
                f"recording out, or check its shaft reference and min_speed."
            )
        jump = jump_statement(recording)
        if jump is not None and jump.value > np.pi:
            raise ValueError(jump.text)


def _bare_channels(entry: Any) -> dict[str, Any]:
    """Name the channels of an array (n_channels, n_times) or a DataFrame."""
    if isinstance(entry, pd.DataFrame):
        check_unique_columns(entry, "it")
        return {name: entry[name] for name in entry.columns}
    array = check_real_array(entry, "the array")
    if array.ndim != 2 or array.shape[0] > array.shape[1]:
        raise ValueError(
            f"an array must have the shape (n_channels, n_times), got {array.shape}. Transpose it."
        )
    return {f"x{i}": row for i, row in enumerate(array)}
