"""Residual signals: recordings less the time-synchronous average of healthy ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_choice, located
from emacm.conditions.healthy import find_healthy, known_conditions
from emacm.conditions.mean_signals import (
    ALIGNMENTS,
    AngleBaseline,
    ResidualRecording,
    mean_baseline,
)
from emacm.conditions.rates import check_rates, common_rates
from emacm.recordings.inputs import as_recordings, check_channels, described
from emacm.recordings.meta import condition_name, sorted_conditions
from emacm.recordings.recording import Recording
from emacm.recordings.transformer import RecordingTransformer
from emacm.resampling.angle_recording import AngleRecording
from emacm.resampling.inputs import as_angle_recordings, check_alike


class SignalBaseline(RecordingTransformer, auto_wrap_output_keys=None):  # type: ignore[call-arg]
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
    healthy : label, collection of labels, mapping or callable, default="normal"
        Healthy recordings: those with these labels in `y`, or with these values in
        `meta` ({key: value or list of values}), or those for which a function returns True.
    baseline_recordings : list of Recording or AngleRecording, optional
        Further healthy recordings, for example of commissioning, used in addition to those in
        X. A condition without healthy recordings in X gets its baseline from them. Recordings
        over time are resampled as X is.
    align : {"angle", "start"}, default="angle"
        Align strokes by their shaft angle, or by the angle travelled since their start, for
        angles without a fixed zero (only a velocity was recorded).

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

    Notes
    -----
    The signals are resampled at whole multiples of `theta_s`, so means and differences are
    computed sample by sample, without interpolation. A mean exists where at least half of the
    healthy recordings have samples (assumed); strokes are cut to this range, and `coverage` gives
    the fraction that remains. Short strokes of a shaft that vibrates at rest would enter the mean:
    set `min_speed` of `OrderResampler` above this motion. Healthy recordings used in training are
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
    >>> residual = SignalBaseline().fit_transform(rows, ["normal", "worn"])
    >>> float(residual[1].strokes[0].signals.mean().round(3))
    0.5
    """

    def __init__(
        self,
        *,
        condition: Any = "load",
        healthy: Any = "normal",
        baseline_recordings: Sequence[Any] | None = None,
        align: str = "angle",
    ) -> None:
        self.condition = condition
        self.healthy = healthy
        self.baseline_recordings = baseline_recordings
        self.align = align

    def fit(self, X: Any, y: ArrayLike | None = None) -> SignalBaseline:
        """Average the healthy recordings of each condition.

        Parameters
        ----------
        X : list of AngleRecording
            Recordings, as `OrderResampler` returns them.
        y : array-like of shape (n_recordings,), optional
            Labels; needed if `healthy` is a label.

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
        check_choice(self.align, "align", ALIGNMENTS)
        rows = as_angle_recordings(X, "SignalBaseline")
        found = find_healthy(rows, y, self.condition, self.healthy, self.baseline_recordings)
        first = rows[0]
        self._check_alike(rows, first)
        with located("baseline_recordings"):
            further = _resampled_as(first, found.further)
            self._check_alike(further, first)
        healthy = [row for row, good in zip(rows, found.mask, strict=True) if good] + further
        self._rates = common_rates(healthy)
        check_rates(rows, self._rates)
        with located("baseline_recordings"):
            check_rates(further, self._rates)
        self.baselines_: dict[Any, AngleBaseline] = {
            condition: mean_baseline(
                [
                    row
                    for row, own in zip(healthy, found.conditions, strict=True)
                    if own == condition
                ],
                align=self.align,
                name=condition_name(self.condition, condition),
            )
            for condition in sorted_conditions(found.conditions)
        }
        self.conditions_ = tuple(self.baselines_)
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
        self._check_alike(rows, self)
        check_rates(rows, self._rates)
        found = known_conditions(rows, self.condition, self.conditions_)
        return [
            ResidualRecording.of(row, self.baselines_[condition])
            for row, condition in zip(rows, found, strict=True)
        ]

    def coverage(self, X: Any) -> pd.DataFrame:
        """Return the fraction of the strokes for which there is a baseline.

        Parameters
        ----------
        X : list of AngleRecording
            Recordings.

        Returns
        -------
        DataFrame
            One row per recording: "revolutions" of its strokes, "covered" (revolutions with a
            baseline), and "share" (covered / revolutions).
        """
        found = np.array([recording.coverage() for recording in self.transform(X)])
        frame = pd.DataFrame(found, columns=["revolutions", "covered"])
        return frame.assign(share=frame["covered"] / frame["revolutions"])

    def __sklearn_tags__(self) -> Any:
        """Declare that y is needed if `healthy` is a label."""
        tags = super().__sklearn_tags__()
        tags.target_tags.required = not (callable(self.healthy) or hasattr(self.healthy, "keys"))
        return tags

    def _check_alike(self, rows: Sequence[AngleRecording], known: Any) -> None:
        """Raise if recordings differ from the first one in `fit`, or from the fitted ones."""
        channels, theta_s = (
            (self.channels_, self.theta_s_) if known is self else (known.channels, known.theta_s)
        )
        check_alike(rows, channels, theta_s, "SignalBaseline")
        for index, row in enumerate(rows):
            with located(partial(described, row, index)):
                if isinstance(row, ResidualRecording):
                    raise TypeError(
                        "it is a residual already; use one SignalBaseline only, or give it the "
                        "output of OrderResampler."
                    )
                if row.direction == "travel" and self.align == "angle":
                    raise ValueError(
                        "align='angle' needs strokes of one direction each, but "
                        "direction='travel' of OrderResampler joins them. Use align='start'."
                    )


def _resampled_as(first: AngleRecording, recordings: list[Any]) -> list[AngleRecording]:
    """Return recordings over the shaft angle, resampled with the settings of another one."""
    if not recordings:
        return []
    rows = as_recordings(recordings, "SignalBaseline", also=(AngleRecording,))
    check_channels(rows, first.channels)
    return [replace(first, measured=row) if isinstance(row, Recording) else row for row in rows]
