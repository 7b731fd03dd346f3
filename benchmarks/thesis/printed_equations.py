"""Equations of the thesis as printed, where emacm uses a corrected form."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def printed_angle(velocity: ArrayLike, fs: float) -> NDArray[np.float64]:
    """Integrate the shaft speed by Eq. (2.9) as printed [1]_.

    The sum lacks parentheses around the two speeds: only the first is summed, and the second is
    added once, without scaling. `emacm.angle_from_velocity` is the corrected form.

    Parameters
    ----------
    velocity : array-like of shape (n_times,)
        Shaft speed [rad/s].
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    ndarray of shape (n_times,)
        Result of the equation; its units are inconsistent.

    References
    ----------
    .. [1] Chirico, Eq. (2.9).

    Examples
    --------
    >>> printed_angle([0.0, 1.0, 2.0], fs=2)
    array([0.  , 1.  , 2.25])
    """
    speed = np.asarray(velocity, dtype=float)
    before = np.concatenate([[0.0], np.cumsum(speed[:-1])])
    return before / (2 * fs) + speed


def printed_resampling(signal: ArrayLike, angle: ArrayLike, theta_s: float) -> NDArray[np.float64]:
    """Resample by Eq. (2.13) as printed [1]_, which adds the slope to the following sample.

    The angle is measured from the preceding sample. At low orders the result is the signal one
    time sample early, so that a line is modulated while the speed varies.
    `emacm.resampling.angle_recording.interpolated` starts from the preceding sample, as linear
    interpolation does.

    Parameters
    ----------
    signal : array-like of shape (n_times,)
        Signal in any unit.
    angle : array-like of shape (n_times,)
        Nondecreasing shaft angle [rad]; angles are relative to the first.
    theta_s : float
        Angle between samples [rad].

    Returns
    -------
    ndarray of shape (n_angles,)
        Signal at multiples of `theta_s`, from the first angle.

    Raises
    ------
    ValueError
        If the angle decreases.

    References
    ----------
    .. [1] Chirico, Eq. (2.13).

    Examples
    --------
    >>> printed_resampling([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], 0.5)
    array([1. , 1.5, 2. , 2.5, 3. ])
    """
    values, turned = (np.asarray(array, dtype=float) for array in (signal, angle))
    if np.any(np.diff(turned) < 0):
        raise ValueError(
            "angle must not decrease; Eq. (2.13) is not defined where the shaft reverses."
        )
    turned = turned - turned[0]
    places = theta_s * np.arange(int(np.floor(turned[-1] / theta_s + 1e-9)) + 1)
    after = np.clip(np.searchsorted(turned, places, side="right"), 1, len(turned) - 1)
    slope = np.diff(values)[after - 1] / np.diff(turned)[after - 1]
    return values[after] + slope * (places - turned[after - 1])
