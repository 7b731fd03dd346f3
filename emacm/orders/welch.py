"""Order spectra by Welch's method: options, spectra of arrays, base of its estimators."""

from __future__ import annotations

from collections.abc import Sequence
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import TransformerMixin
from sklearn.utils.validation import check_is_fitted

from emacm._checks import (
    check_choice,
    check_count,
    check_finite,
    check_number,
    check_real_array,
)
from emacm._saved import SavedEstimator
from emacm.orders.columns import check_input_names
from emacm.orders.segment_plan import SegmentPlan, window_values


def segment_plan(
    samples_per_rev: float,
    *,
    revolutions: float = 16,
    n_per_segment: int | None = None,
    window: Any = "hann",
    overlap: float = 0.5,
    detrend: Any = "constant",
    scaling: str = "density",
    average: str = "mean",
    max_order: float | None = None,
    by_direction: bool = False,
    short: str = "raise",
) -> SegmentPlan:
    """Check the options of Welch's method, whose defaults are given here, and plan its segments.

    Parameters
    ----------
    samples_per_rev : float
        Samples per shaft revolution, 2π/theta_s.
    revolutions : float
        Length of a segment; the distance between spectral lines is 1/revolutions (to the nearest
        whole number of samples).
    n_per_segment : int, optional
        Length of a segment in samples, in place of `revolutions`.
    window : str, tuple or array-like of shape (n_per_segment,)
        As for `scipy.signal.get_window`. "hann" is Chirico, Eq. (2.17).
    overlap : float
        Fraction of a segment that overlaps the next one, in [0, 1).
    detrend : {"constant", "linear", None, False}
        What is removed from each segment. "constant" distorts the first two lines, so bins of
        interest should begin above them.
    scaling : {"density", "spectrum"}
        "density" [U²/order] integrates to the mean square. In "spectrum" [U²] a tone of amplitude A
        has the value A²/2, and lines must not be summed.
    average : {"mean", "median"}
        "median" is less affected by single shocks; it is corrected for its bias on noise, as in
        `scipy.signal.welch`.
    max_order : float, optional
        Highest order of interest: lines above the first one at or above it are omitted.
    by_direction : bool
        Average forward and reverse strokes separately.
    short : {"raise", "pad"}
        For a recording whose strokes are all shorter than a segment: an error, or zero padding.

    Raises
    ------
    TypeError, ValueError
        If an option is invalid.
    """
    samples_per_rev = check_number(samples_per_rev, "samples_per_rev", above=0)
    if n_per_segment is not None:
        length = check_count(n_per_segment, "n_per_segment", at_least=2)
    else:
        length = round(check_number(revolutions, "revolutions", above=0) * samples_per_rev)
    if not 2 <= length <= 1 << 31:
        raise ValueError(
            f"a segment must have 2 to 2**31 samples, got {length:.4g} from n_per_segment = "
            f"{n_per_segment}, revolutions = {revolutions} and {samples_per_rev:g} samples per "
            f"revolution. Change one of them, or theta_s."
        )
    overlap = check_number(overlap, "overlap", at_least=0, below=1)
    check_choice(detrend, "detrend", ("constant", "linear", None, False))
    check_choice(scaling, "scaling", ("density", "spectrum"))
    check_choice(average, "average", ("mean", "median"))
    check_choice(by_direction, "by_direction", (True, False))
    check_choice(short, "short", ("raise", "pad"))
    n_orders = length // 2 + 1
    if max_order is not None:
        top = check_number(max_order, "max_order", at_least=0, unit="orders")
        # The line at or above the limit is kept, so that bins up to the limit can be integrated.
        n_orders = min(n_orders, int(np.ceil(top * length / samples_per_rev - 1e-9)) + 1)
    step = length - min(int(overlap * length), length - 1)
    return SegmentPlan(
        samples_per_rev,
        length,
        step,
        window,
        window_values(window, length),
        detrend,
        scaling,
        average,
        n_orders,
        bool(by_direction),
        short,
    )


def samples_per_revolution(theta_s: float) -> float:
    """Return 2π/theta_s, rounded to a whole number where it differs by rounding errors only.

    Parameters
    ----------
    theta_s : float
        Angle between samples [rad].

    Returns
    -------
    float

    Examples
    --------
    >>> import numpy as np
    >>> 2 * np.pi / (2 * np.pi / 100), samples_per_revolution(2 * np.pi / 100)
    (99.99999999999999, 100.0)
    """
    samples = 2 * np.pi / check_number(theta_s, "theta_s", above=0, unit="rad per sample")
    whole = np.rint(samples)
    return float(whole if abs(samples - whole) <= 1e-14 * samples else samples)


_OPTIONS = tuple(signature(segment_plan).parameters)[1:]


def order_psd(
    signal: ArrayLike, samples_per_rev: float, **options: Any
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Estimate the order power spectral density by Welch's method.

    Parameters
    ----------
    signal : array-like of shape (..., n_angles)
        Signal at uniform shaft angles, in any unit U.
    samples_per_rev : float
        Samples per shaft revolution, 2π/theta_s.
    **options
        `revolutions`, `n_per_segment`, `window`, `overlap`, `detrend`, `scaling`, `average` and
        `max_order`, as for `segment_plan`.

    Returns
    -------
    orders : ndarray of shape (n_orders,)
        Orders, in cycles per revolution.
    psd : ndarray of shape (..., n_orders)
        Power spectral density [U²/order], or power spectrum [U²].

    Raises
    ------
    TypeError, ValueError
        If an option is invalid, or the signal is shorter than a segment.

    Examples
    --------
    >>> import numpy as np
    >>> angle = 2 * np.pi / 64 * np.arange(64 * 100)
    >>> orders, psd = order_psd(3 * np.sin(7 * angle), 64)
    >>> print(orders[psd.argmax()], round(psd.sum() * orders[1], 6))
    7.0 4.5
    """
    plan = segment_plan(samples_per_rev, **options)
    signal = check_real_array(signal, "signal")
    check_finite(signal.reshape(-1), "signal")
    if signal.ndim == 0 or signal.size == 0 or signal.shape[-1] < plan.n_per_segment:
        raise ValueError(
            f"signal of shape {signal.shape} holds no segment of {plan.n_per_segment} samples "
            f"({plan.revolutions:g} revolutions). Lower revolutions or n_per_segment."
        )
    psd = plan.average_of([signal.reshape(-1, signal.shape[-1])])
    return plan.orders, psd.reshape(*signal.shape[:-1], plan.n_orders)


class WelchEstimator(TransformerMixin, SavedEstimator):
    """Base of the estimators that average over segments of recordings over shaft angle.

    A subclass has options of `segment_plan` among its parameters. Its `fit` sets `theta_s_`, calls
    `_set_plan`, and sets the names of the columns and the attributes of its input.
    """

    theta_s_: float | None
    orders_: NDArray[np.floating]
    n_per_segment_: int
    by_direction: bool | str
    by_direction_: bool
    _plan: SegmentPlan
    _columns_out: tuple[str, ...]
    _names_in: Sequence[str] | None
    _n_in: int | None

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Return the names of the columns.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the input: channels, or the samples of a row. If given, they are compared with
            those of `fit`.

        Returns
        -------
        ndarray of str
        """
        check_is_fitted(self)
        if input_features is not None:
            check_input_names(input_features, self._names_in, self._n_in)
        return np.array(self._columns_out, dtype=object)

    def _set_plan(self, samples_per_rev: float, **changed: Any) -> None:
        """Plan the segments, as the parameters say, and keep the axis."""
        stated = {name: getattr(self, name) for name in _OPTIONS if hasattr(self, name)}
        changed["by_direction"] = self.by_direction_
        self._plan = segment_plan(samples_per_rev, **stated | changed)
        self.orders_ = self._plan.orders
        self.n_per_segment_ = self._plan.n_per_segment
