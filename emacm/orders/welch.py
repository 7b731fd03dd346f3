"""Order spectra by Welch's method: of arrays, and what its estimators have in common."""

from __future__ import annotations

from collections.abc import Sequence
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import TransformerMixin
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_finite, check_real_array
from emacm._saved import SavedEstimator
from emacm.orders.columns import check_input_names
from emacm.orders.segment_plan import SegmentPlan, segment_plan
from emacm.resampling.angle_recording import AngleRecording
from emacm.resampling.inputs import check_theta_s, check_ways_apart

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
    signal = check_holds_segment(signal, "signal", plan)
    psd = plan.average_of([signal.reshape(-1, signal.shape[-1])])
    return plan.orders, psd.reshape(*signal.shape[:-1], plan.n_orders)


def check_holds_segment(values: ArrayLike, name: str, plan: SegmentPlan) -> NDArray[np.floating]:
    """Return a finite array of shape (..., n_angles) that is at least as long as a segment."""
    signal = check_real_array(values, name)
    check_finite(signal.reshape(-1), name)
    if signal.ndim == 0 or signal.size == 0 or signal.shape[-1] < plan.n_per_segment:
        raise ValueError(
            f"{name} of shape {signal.shape} holds no segment of {plan.n_per_segment} samples "
            f"({plan.revolutions:g} revolutions). Lower revolutions or n_per_segment."
        )
    return signal


class WelchEstimator(TransformerMixin, SavedEstimator):
    """Base of the estimators that average over segments of recordings over shaft angle.

    A subclass has options of `segment_plan` among its parameters. Its `fit` sets `theta_s_`, calls
    `_set_plan`, and sets the names of the columns and what is known of its input.
    """

    theta_s_: float | None
    orders_: NDArray[np.floating]
    n_per_segment_: int
    by_direction: bool
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
        self._plan = segment_plan(samples_per_rev, **stated | changed)
        self.orders_ = self._plan.orders
        self.n_per_segment_ = self._plan.n_per_segment

    def _check_over_angle(self, rows: Sequence[AngleRecording]) -> None:
        """Compare recordings with the angle step of `fit`, and with `by_direction`."""
        check_theta_s(rows, self.theta_s_, type(self).__name__)
        if self.by_direction:
            check_ways_apart(rows)
