"""What pairs of channels have in common over orders, as a step of a pipeline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from joblib import delayed
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_choice
from emacm._progress import run
from emacm.orders.bins import Band, bin_operator, named_bins
from emacm.orders.columns import OrderTable, check_input_names, order_columns
from emacm.orders.pair_columns import FORMS, PairColumns, check_kinds
from emacm.orders.welch import SHORTS, samples_per_revolution, segment_plan
from emacm.recordings.inputs import check_channels
from emacm.resampling.angle_recording import AngleRecording
from emacm.resampling.inputs import (
    as_angle_recordings,
    check_theta_s,
    check_ways_apart,
)


class OrderCrossSpectrum(TransformerMixin, BaseEstimator):
    """Estimate cross spectra, coherence or frequency response of channels over orders.

    By Welch's averages, as `OrderPSD`. The phase between two channels does not depend on the
    absolute shaft angle: the same fault, put together otherwise, reads the same.

    Parameters
    ----------
    revolutions : float
        Length of a segment, so lines lie 1/revolutions orders apart.
    pairs : sequence of (str, str), optional
        Input and output channels. Default: all pairs, the input being the channel that comes first.
        Channels in no pair are not resampled.
    kind : {"response", "coherence", "cross"} or sequence of these
        "response" is H1 = S_xy / S_xx [U_y/U_x], "coherence" the magnitude-squared one, "cross" the
        cross-spectral density S_xy [U_x U_y/order]. Several are made at the price of one.
    form : {"rectangular", "polar", "log"}
        What complex kinds give: real and imaginary part, magnitude and phase [rad], or
        natural logarithm of the magnitude and phase. Phases jump at ±π, and a mean over recordings
        goes wrong there; "rectangular" has no such place.
    bin_size : float, optional
        Width of bins [orders], up to `max_order`. Ratios are formed after power and cross spectra
        were integrated over the bins.
    edges : array-like of shape (n_bins + 1,) or mapping of str to (low, high), optional
        Bins of one's own, as for `BinTransformer`.
    stop_bands : sequence of (low, high)
        Bands that are taken out of the bins [orders].
    n_per_segment : int, optional
        Length of a segment in samples, in place of `revolutions`.
    window : str, tuple or array-like of shape (n_per_segment,)
        As for `scipy.signal.get_window`.
    overlap : float
        Share that adjoining segments have in common, in [0, 1).
    detrend : {"constant", "linear", None, False}
        What is taken out of each segment. It leaves nothing but leakage in the first two lines.
    by_direction : bool
        Give forward and reverse strokes columns of their own, ``…+@…`` and ``…-@…``.
    short : {"raise", "pad"}
        What becomes of a recording without a stroke as long as a segment: an error, or an
        estimate in which each stroke, padded with zeros, is one segment and counts by its length.
    max_order : float, optional
        Highest order of interest: where bins end, or above which lines are cut.
    verbose : bool or int
        Report to stderr how many recordings are done, as `OrderPSD` does.
    n_jobs : int, optional
        Recordings in work at the same time, under joblib's active backend (by default, threads).

    Attributes
    ----------
    pairs_ : tuple of (str, str)
        Input and output of each pair.
    channels_ : tuple of str
        Channels that are read.
    orders_ : ndarray of shape (n_orders,)
        Orders of the lines.
    bins_ : tuple of (low, high), or None
        Edges of the bins [orders].
    n_per_segment_ : int
        Samples of a segment.
    theta_s_ : float
        Angle between samples [rad].

    Notes
    -----
    `X` is what `OrderResampler` returns. Recordings are resampled when their turn comes, in blocks.

    Columns are named ``input*output:quantity@order``, or ``@low-high`` in bins: pair by pair, of
    each the kinds as given, such as ``current*error:response.real@1`` or
    ``current*error:coherence@1``; with `by_direction` ``current*error:coherence+@1``.

    Lines go through `BinTransformer` if they are ``kind="cross", form="rectangular"``, whose
    integrals mean something. An integral of coherence or response over lines weighs all
    lines alike, also those without power; set `bin_size` here in their place.

    Of n independent segments of unrelated noise, coherence is 1/n on average, of a single one
    always 1, which is refused. Recordings with more segments have less of that bias: compare
    recordings of about equal length. Noise of the input makes the response too small.

    Bins want to be narrow against 1/delay: where one channel lags by a revolution, the phase goes
    round once in an order, and the cross spectrum of a bin of that width cancels.

    The phase of a reverse stroke is along its own motion: what comes later in time lags there too.

    Source: Bendat and Piersol, Random Data, 4th ed., Wiley, 2010, ch. 6 and 11.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import OrderCrossSpectrum, OrderResampler, Recording
    >>> speed = np.full(20_000, 60.0)
    >>> torque = np.random.default_rng(0).standard_normal(20_000)
    >>> run = Recording({"torque": torque, "current": 4 * torque}, 1000, velocity=speed)
    >>> over_angle = OrderResampler().fit_transform([run])
    >>> cross = OrderCrossSpectrum(8, bin_size=2, max_order=4).set_output(transform="pandas")
    >>> cross.fit_transform(over_angle).round(3).iloc[:, :2]
       torque*current:response.real@0-2  torque*current:response.real@2-4
    0                               4.0                               4.0
    """

    def __init__(
        self,
        revolutions: float = 16,
        *,
        pairs: Sequence[tuple[str, str]] | None = None,
        kind: str | Sequence[str] = "response",
        form: str = "rectangular",
        bin_size: float | None = None,
        edges: ArrayLike | Mapping[str, Band] | None = None,
        stop_bands: Sequence[Band] = (),
        n_per_segment: int | None = None,
        window: Any = "hann",
        overlap: float = 0.5,
        detrend: Any = "constant",
        by_direction: bool = False,
        short: str = "raise",
        max_order: float | None = None,
        verbose: bool | int = False,
        n_jobs: int | None = None,
    ) -> None:
        self.revolutions = revolutions
        self.pairs = pairs
        self.kind = kind
        self.form = form
        self.bin_size = bin_size
        self.edges = edges
        self.stop_bands = stop_bands
        self.n_per_segment = n_per_segment
        self.window = window
        self.overlap = overlap
        self.detrend = detrend
        self.by_direction = by_direction
        self.short = short
        self.max_order = max_order
        self.verbose = verbose
        self.n_jobs = n_jobs

    def fit(self, X: Any, y: Any = None) -> OrderCrossSpectrum:
        """Learn pairs and axis; no spectrum is estimated.

        Parameters
        ----------
        X : list of AngleRecording
            Recordings over the shaft angle.
        y : ignored

        Returns
        -------
        OrderCrossSpectrum
            Itself.

        Raises
        ------
        TypeError, ValueError
            If a parameter or X is not what it should be.
        """
        check_choice(self.by_direction, "by_direction", (True, False))
        check_choice(self.short, "short", SHORTS)
        rows = as_angle_recordings(X, "OrderCrossSpectrum")
        self.theta_s_ = rows[0].theta_s
        self.pairs_ = _checked_pairs(self.pairs, rows[0].channels)
        self.channels_ = tuple(dict.fromkeys(name for pair in self.pairs_ for name in pair))
        self._channels_in = rows[0].channels
        self._check_rows(rows)
        plan = segment_plan(
            samples_per_revolution(self.theta_s_),
            revolutions=self.revolutions,
            n_per_segment=self.n_per_segment,
            window=self.window,
            overlap=self.overlap,
            detrend=self.detrend,
            max_order=self.max_order,
        )
        self.orders_ = plan.orders
        self.n_per_segment_ = plan.n_per_segment
        bins = self._bins()
        self.bins_ = None if bins is None else tuple(bins.values())
        places = [self.channels_.index(name) for pair in self.pairs_ for name in pair]
        self._columns = PairColumns(
            plan,
            self.channels_,
            tuple(zip(places[::2], places[1::2], strict=True)),
            check_kinds(self.kind),
            check_choice(self.form, "form", tuple(FORMS)),
            None if bins is None else self._operator(list(bins.values())),
            self.by_direction,
            self.short,
        )
        self._columns_out = (
            order_columns(self._columns.names, self.orders_)
            if bins is None
            else tuple(f"{name}@{band}" for name in self._columns.names for band in bins)
        )
        return self

    def transform(self, X: Any) -> NDArray[np.floating]:
        """Estimate what the pairs have in common, one recording at a time.

        Parameters
        ----------
        X : list of AngleRecording
            Recordings at the theta_s seen in `fit` that have its channels.

        Returns
        -------
        ndarray of shape (n_recordings, n_columns)
            An OrderTable, whose ``columns`` name the orders, where there are no bins.

        Raises
        ------
        TypeError, ValueError
            If a recording lacks a channel, has another theta_s, holds no segment (for coherence:
            two), or if a channel has no power at all. The message names it.
        """
        check_is_fitted(self)
        rows = as_angle_recordings(X, "OrderCrossSpectrum")
        self._check_rows(rows)
        tasks = (delayed(self._columns.of)(row, index) for index, row in enumerate(rows))
        features = run(tasks, len(rows), n_jobs=self.n_jobs, verbose=self.verbose)
        table = np.stack(features).reshape(len(rows), -1)
        return table if self.bins_ is not None else OrderTable(table, self._columns_out)

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Return the names of the columns, ``input*output:quantity@order``.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the channels; if given, they must be those of the first recording in `fit`.

        Returns
        -------
        ndarray of str
        """
        check_is_fitted(self)
        if input_features is not None:
            check_input_names(input_features, self._channels_in, len(self._channels_in))
        return np.array(self._columns_out, dtype=object)

    def __sklearn_tags__(self) -> Any:
        """Tell scikit-learn that X is no 2-D table."""
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        return tags

    def _check_rows(self, rows: list[AngleRecording]) -> None:
        check_channels(rows, self.channels_)
        check_theta_s(rows, self.theta_s_, "OrderCrossSpectrum")
        if self.by_direction:
            check_ways_apart(rows)

    def _bins(self) -> dict[str, Band] | None:
        if self.bin_size is None and self.edges is None:
            if len(self.stop_bands):
                raise ValueError("stop_bands are taken out of bins; set bin_size or edges too.")
            return None
        size = 1.0 if self.bin_size is None else self.bin_size  # edges are given then
        top = self.orders_[-1] if self.max_order is None else self.max_order
        return named_bins(size, top, self.edges, self.stop_bands)

    def _operator(self, bins: list[Band]) -> sparse.csr_array:
        return sparse.csr_array(bin_operator(self.orders_, bins, stop_bands=self.stop_bands))


def _checked_pairs(pairs: Any, channels: Sequence[str]) -> tuple[tuple[str, str], ...]:
    if pairs is None:
        if len(channels) < 2:
            raise ValueError(
                f"a pair needs two channels, but the recordings have {list(channels)} only. "
                f"Give OrderResampler more of them."
            )
        return tuple(combinations(channels, 2))
    if isinstance(pairs, str | Mapping) or not np.iterable(pairs):
        raise TypeError(f"pairs must be a list of (input, output) channels, got {pairs!r}.")
    checked = []
    for pair in pairs:
        if isinstance(pair, str) or not np.iterable(pair) or len(list(pair)) != 2:
            raise TypeError(
                f"pairs must be a list of (input, output) channels, such as "
                f"[('torque', 'current')]; got {pair!r} in it."
            )
        x, y = pair
        for name in (x, y):
            if name not in channels:
                raise ValueError(
                    f"pairs name a channel {name!r}, but the recordings have {list(channels)}."
                )
        if x == y:
            raise ValueError(f"a pair needs two channels, got {pair!r}.")
        checked.append((x, y))
    if not checked or len(set(checked)) < len(checked):
        raise ValueError(f"pairs must name one or more pairs, each once; got {pairs!r}.")
    return tuple(checked)
