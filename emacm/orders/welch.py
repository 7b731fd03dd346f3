"""Order spectra by Welch's method: options, spectra of arrays, base of its estimators."""

from __future__ import annotations

from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_finite, check_number, check_real_array
from emacm.orders.columns import NamedColumns
from emacm.orders.segment_plan import SegmentPlan


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


_OPTIONS = tuple(signature(SegmentPlan).parameters)[1:]


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
        `max_order`, as for `SegmentPlan`.

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
    plan = SegmentPlan(samples_per_rev, **options)
    signal = check_real_array(signal, "signal")
    check_finite(signal.reshape(-1), "signal")
    if signal.ndim == 0 or signal.size == 0 or signal.shape[-1] < plan.n_per_segment:
        raise ValueError(
            f"signal of shape {signal.shape} holds no segment of {plan.n_per_segment} samples "
            f"({plan.revolutions:g} revolutions). Lower revolutions or n_per_segment."
        )
    psd = plan.average_of([signal.reshape(-1, signal.shape[-1])])
    return plan.orders, psd.reshape(*signal.shape[:-1], plan.n_orders)


class WelchEstimator(NamedColumns):
    """Base of the estimators that average over segments of recordings over shaft angle.

    A subclass has options of `SegmentPlan` among its parameters. Its `fit` sets `by_direction_` and
    calls `_set_plan`.
    """

    by_direction_: bool

    def _set_plan(self, samples_per_rev: float, **changed: Any) -> None:
        """Plan the segments, as the parameters say, and keep the axis."""
        stated = {name: getattr(self, name) for name in _OPTIONS if hasattr(self, name)}
        changed["by_direction"] = self.by_direction_
        self.plan_ = SegmentPlan(samples_per_rev, **stated | changed)
        self.orders_ = self.plan_.orders
        self.n_per_segment_ = self.plan_.n_per_segment
