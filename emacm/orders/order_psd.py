"""The second step of a pipeline: the power spectral density over orders."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import PurePath
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from emacm._checks import (
    check_choice,
    check_finite_table,
    check_number,
    check_signal,
    located,
)
from emacm._version import __version__
from emacm.orders.columns import BARE_CHANNEL, OrderTable, check_input_names, order_columns
from emacm.orders.recalled_spectra import recalled_spectra
from emacm.orders.store import open_store
from emacm.orders.welch import SHORTS, SegmentPlan, samples_per_revolution, segment_plan, too_short
from emacm.recordings.inputs import as_list, check_channels, described, refuse_single
from emacm.recordings.recording import Recording
from emacm.resampling.angle_recording import AngleRecording, AngleStroke
from emacm.resampling.inputs import (
    as_angle_recordings,
    check_theta_s,
    check_ways_apart,
    strokes_by_kind,
)


class OrderPSD(TransformerMixin, BaseEstimator):
    """Estimate the power spectral density over orders, by Welch's method.

    Parameters
    ----------
    revolutions : float
        Length of a segment, so lines lie 1/revolutions orders apart, whatever
        theta_s is (to the nearest whole number of samples).
    n_per_segment : int, optional
        Length of a segment in samples (the thesis' L), in place of `revolutions`.
    window : str, tuple or array-like of shape (n_per_segment,)
        As for `scipy.signal.get_window`.
    overlap : float
        Share that adjoining segments have in common, in [0, 1).
    detrend : {"constant", "linear", None, False}
        What is taken out of each segment.
    scaling : {"density", "spectrum"}
        "density" [U²/order] integrates to the mean square, as bins need it. In
        "spectrum" [U²] a tone of amplitude A reads A²/2.
    average : {"mean", "median"}
        How the segments of a recording are joined.
    by_direction : bool
        Give forward and reverse strokes columns of their own, ``channel+@…``
        and ``channel-@…``.
    short : {"raise", "pad"}
        What becomes of a recording without a stroke as long as a segment: an
        error, or an estimate padded with zeros, to which each stroke
        contributes by its length (whatever `average` says).
    max_order : float, optional
        Highest order of interest: columns above the first one at or above it are cut.
    theta_s : float, optional
        Angle between samples [rad] of bare rows. Recordings know theirs.
    memory : None, str, path, joblib.Memory or SpectrumStore
        Folder where spectra are kept between calls, folds, candidates of a search
        and processes, up to 1 GiB (`emacm.orders.store.SpectrumStore` sets another
        limit). A spectrum is found again by the content of its recording and all
        settings, of the resampling too. Resampled signals are not kept.
    verbose : bool or int
        Report to stderr how many recordings are done, the rate and the time left: by
        tqdm, if it is installed, or else by joblib (the higher, the more often).
    n_jobs : int, optional
        Recordings in work at the same time, under joblib's active backend
        (by default, threads).

    Attributes
    ----------
    orders_ : ndarray of shape (n_orders,)
        Orders of the lines; in cycles per sample for bare rows without `theta_s`.
    order_step_ : float
        True distance of two lines [orders].
    n_per_segment_ : int
        Samples of a segment.
    channels_ : tuple of str
        Channels of the recordings.
    theta_s_ : float or None
        Angle between samples [rad].
    n_features_in_ : int
        Samples of a row, where X is a 2-D table.

    Notes
    -----
    `X` is what `OrderResampler` returns. It may also be a 2-D array whose rows
    are equally long signals over the angle, or a list of 1-D arrays of any
    lengths. With ``theta_s=None`` such rows have no axis: a sample counts as a
    revolution, and a segment is at most the row, as in `scipy.signal.welch`.

    Source: Chirico, Eqs. (2.14) to (2.22).

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import OrderPSD
    >>> angle = 2 * np.pi / 64 * np.arange(64 * 40)
    >>> rows = [np.sin(5 * angle), np.sin(9 * angle)]
    >>> psd = OrderPSD(8, theta_s=2 * np.pi / 64)
    >>> power = psd.fit_transform(rows)
    >>> psd.orders_[power.argmax(axis=1)]
    array([5., 9.])
    """

    def __init__(
        self,
        revolutions: float = 16,
        *,
        n_per_segment: int | None = None,
        window: Any = "hann",
        overlap: float = 0.5,
        detrend: Any = "constant",
        scaling: str = "density",
        average: str = "mean",
        by_direction: bool = False,
        short: str = "raise",
        max_order: float | None = None,
        theta_s: float | None = None,
        memory: Any = None,
        verbose: bool | int = False,
        n_jobs: int | None = None,
    ) -> None:
        self.revolutions = revolutions
        self.n_per_segment = n_per_segment
        self.window = window
        self.overlap = overlap
        self.detrend = detrend
        self.scaling = scaling
        self.average = average
        self.by_direction = by_direction
        self.short = short
        self.max_order = max_order
        self.theta_s = theta_s
        self.memory = memory
        self.verbose = verbose
        self.n_jobs = n_jobs

    def fit(self, X: Any, y: Any = None) -> OrderPSD:
        """Learn the axis; no spectrum is estimated.

        Parameters
        ----------
        X : list of AngleRecording, 2-D array or list of 1-D arrays
            Signals over the shaft angle.
        y : ignored

        Returns
        -------
        OrderPSD
            Itself.

        Raises
        ------
        TypeError, ValueError
            If a parameter or X is not what it should be.
        """
        for seen in ("n_features_in_", "feature_names_in_"):
            self.__dict__.pop(seen, None)  # of an earlier fit on a table
        rows = self._checked(X, reset=True)
        self.theta_s_ = self._stated_theta_s(rows[0])
        self._recorded = isinstance(rows[0], AngleRecording)
        self.channels_ = rows[0].channels if self._recorded else (BARE_CHANNEL,)
        if self._recorded:
            self._check_recordings(rows)
        self._plan = self._segment_plan(rows)
        self.orders_ = self._plan.orders
        self.order_step_ = self._plan.order_step
        self.n_per_segment_ = self._plan.n_per_segment
        self._columns_out = self._column_names()
        return self

    def transform(self, X: Any) -> NDArray[np.floating]:
        """Estimate the spectra, one recording at a time.

        Parameters
        ----------
        X : list of AngleRecording, 2-D array or list of 1-D arrays
            Signals over the shaft angle, at the theta_s seen in `fit`.

        Returns
        -------
        OrderTable of shape (n_recordings, n_columns)
            Power spectral densities [U²/order], channel by channel; an array
            whose ``columns`` are named ``channel@order``. Without an axis, a
            plain array.

        Raises
        ------
        TypeError, ValueError
            If theta_s or channels are not those of `fit`, or a recording holds
            no segment (the message names it and its revolutions).
        """
        check_is_fitted(self)
        rows = self._checked(X, reset=False)
        if isinstance(rows[0], AngleRecording):
            self._check_recordings(rows)
        elif self._recorded:
            raise ValueError(
                "X holds bare rows, but OrderPSD was fitted on recordings of channels "
                f"{list(self.channels_)}. Pass what OrderResampler returns, or fit again."
            )
        settings: dict[str, Any] = {
            "plan": self._plan,
            "by_direction": self.by_direction,
            "short": self.short,
        }
        spectra = recalled_spectra(
            partial(_located_call, partial(_spectra, **settings)),
            rows,
            open_store(self.memory),
            settings | {"version": __version__},
            n_jobs=self.n_jobs,
            verbose=self.verbose,
        )
        table = np.stack(spectra).reshape(len(rows), -1)
        return table if self.theta_s_ is None else OrderTable(table, self._columns_out)

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Return the names of the columns, ``channel@order``.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of what went in: channels, or the samples of a row.

        Returns
        -------
        ndarray of str
            For bare rows without an axis, "line0", "line1" and so on.
        """
        check_is_fitted(self)
        if input_features is not None:
            n_expected = getattr(self, "n_features_in_", None)
            if self._recorded:
                n_expected = len(self.channels_)
            check_input_names(input_features, getattr(self, "feature_names_in_", None), n_expected)
        return np.array(self._columns_out, dtype=object)

    def _checked(self, X: Any, *, reset: bool) -> Sequence[Any]:
        """Return the rows of X: recordings over the angle, or 1-D arrays."""
        check_choice(self.by_direction, "by_direction", (True, False))
        check_choice(self.short, "short", SHORTS)
        refuse_single(X)
        if isinstance(X, str | PurePath | Sequence) or _object_vector(X):
            rows = as_list(X)
            if any(isinstance(row, AngleRecording | Recording | str | PurePath) for row in rows):
                return as_angle_recordings(rows, "OrderPSD")
            if self.theta_s is not None or _ragged(rows):
                return self._checked_rows(rows)
        self._refuse_direction()
        least = 2 if reset else 1  # later, a wrong number of columns has a better answer
        table = validate_data(
            self,
            X,
            reset=reset,
            dtype=[np.float64, np.float32],
            ensure_min_features=least,
            ensure_all_finite=False,
        )
        check_finite_table(table, "row")
        return table

    def _checked_rows(self, rows: list[Any]) -> list[NDArray[np.floating]]:
        self._refuse_direction()
        return [check_signal(row, f"row {i}") for i, row in enumerate(rows)]

    def _refuse_direction(self) -> None:
        if self.by_direction:
            raise ValueError(
                "by_direction needs recordings over the angle, as OrderResampler makes them; "
                "bare rows have no direction."
            )

    def _check_recordings(self, rows: Sequence[AngleRecording]) -> None:
        """Compare recordings with the axis and the channels of `fit`."""
        for index, row in enumerate(rows):
            if not self._recorded:
                raise ValueError(
                    f"{described(row, index)} is a recording, but OrderPSD was fitted on bare "
                    f"rows. Fit it again."
                )
        check_channels(rows, self.channels_, others=False, ordered=True)
        check_theta_s(rows, self.theta_s_, "OrderPSD")
        if self.by_direction:
            check_ways_apart(rows)

    def _stated_theta_s(self, first: Any) -> float | None:
        stated = self.theta_s
        if stated is not None:
            stated = check_number(stated, "theta_s", above=0, unit="rad per sample")
        if not isinstance(first, AngleRecording):
            return stated
        if stated is not None and not np.isclose(stated, first.theta_s, rtol=1e-12, atol=0):
            raise ValueError(
                f"theta_s = {stated!r} contradicts the recordings, which were resampled with "
                f"{first.theta_s!r}. Leave theta_s of OrderPSD out; recordings know theirs."
            )
        return first.theta_s

    def _segment_plan(self, rows: Sequence[Any]) -> SegmentPlan:
        plan = partial(
            segment_plan,
            window=self.window,
            overlap=self.overlap,
            detrend=self.detrend,
            scaling=self.scaling,
            average=self.average,
            max_order=self.max_order,
        )
        if self.theta_s_ is not None:
            return plan(
                samples_per_revolution(self.theta_s_),
                revolutions=self.revolutions,
                n_per_segment=self.n_per_segment,
            )
        wanted = plan(1.0, revolutions=self.revolutions, n_per_segment=self.n_per_segment)
        shortest = min(len(row) for row in rows)
        if wanted.n_per_segment <= shortest:
            return wanted
        return plan(1.0, n_per_segment=shortest)

    def _column_names(self) -> tuple[str, ...]:
        if self.theta_s_ is None:
            return tuple(f"line{k}" for k in range(len(self.orders_)))
        channels = self.channels_
        if self.by_direction:
            channels = tuple(channel + sign for channel in channels for sign in "+-")
        return order_columns(channels, self.orders_)


def _object_vector(X: Any) -> bool:
    return isinstance(X, np.ndarray) and X.ndim == 1 and X.dtype.hasobject


def _ragged(rows: list[Any]) -> bool:
    """Tell whether these are one-dimensional rows of unequal length."""
    try:
        shapes = {np.shape(row) for row in rows}
    except ValueError:
        return False
    return len(shapes) > 1 and all(len(shape) == 1 for shape in shapes)


class _Row(NamedTuple):
    """A bare row, in the place of a stroke."""

    signals: NDArray[np.floating]

    @property
    def n_angles(self) -> int:
        return self.signals.shape[-1]

    def blocks(self, rows: Sequence[int]) -> list[NDArray[np.floating]]:
        return [self.signals[rows]]


def _spectra(
    row: AngleRecording | NDArray[np.floating],
    plan: SegmentPlan,
    by_direction: bool,
    short: str,
) -> NDArray[np.floating]:
    """Estimate the spectra of one recording, shape (n_channels, [2,] n_orders)."""
    if isinstance(row, np.ndarray):
        return _estimate([_Row(row[np.newaxis])], [[0]], plan, short, "row")
    strokes, groups = row.strokes, row.rate_groups
    kinds = [
        _estimate(some, groups, plan, short, kind)
        for kind, some in strokes_by_kind(strokes, by_direction)
    ]
    return np.stack(kinds, axis=1) if by_direction else kinds[0]


def _estimate(
    strokes: Sequence[AngleStroke | _Row],
    groups: list[list[int]],
    plan: SegmentPlan,
    short: str,
    kind: str,
) -> NDArray[np.floating]:
    """Average over the strokes that hold a segment, resampling them a block at a time.

    `groups` holds the numbers of the channels that have one sampling rate.
    """
    whole = [stroke for stroke in strokes if stroke.n_angles >= plan.n_per_segment]
    if whole:
        parts = {tuple(rows): plan.average_of(s.blocks(rows) for s in whole) for rows in groups}
        if len(parts) == 1:
            return next(iter(parts.values()))
        order = np.argsort([row for rows in parts for row in rows])
        return np.concatenate(list(parts.values()))[order]
    longest = max((stroke.n_angles for stroke in strokes), default=0)
    if short == "pad" and longest > 1:
        return plan.padded(stroke.signals for stroke in strokes)
    raise too_short(strokes, plan, kind, "OrderPSD")


def _located_call(estimate: Callable[..., Any], row: Any, index: int) -> NDArray[np.floating]:
    with located(described(row, index) if isinstance(row, AngleRecording) else f"row {index}"):
        with np.errstate(over="ignore", invalid="ignore"):
            spectra = estimate(row)
        if not np.isfinite(spectra.max()):  # powers: nothing is below 0
            raise ValueError(
                "its power is beyond what a float can hold. State the channels in other units."
            )
        return spectra
