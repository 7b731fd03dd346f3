"""Time-synchronous average, residual and difference signal of gears, and their indicators.

All signals are one revolution of the shaft of the gear, at uniform angles.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_count, check_signal

Array = NDArray[np.float64]


def mesh_orders(teeth: int, n_samples: int, *, sidebands: int = 0) -> NDArray[np.intp]:
    """Return the orders of the regular meshing components.

    Parameters
    ----------
    teeth : int
        Teeth of the gear, which is the order of the mesh.
    n_samples : int
        Samples per revolution.
    sidebands : int
        Number of sidebands on either side of each harmonic.

    Returns
    -------
    ndarray of shape (n_orders,), of int
        Harmonics of the mesh below half the samples per revolution, with their sidebands.

    Examples
    --------
    >>> mesh_orders(9, 50, sidebands=1).tolist()
    [8, 9, 10, 17, 18, 19]
    """
    check_count(teeth, "teeth", at_least=2)
    highest = (n_samples - 1) // 2
    if teeth + sidebands > highest:
        raise ValueError(
            f"{teeth} teeth and {sidebands} sidebands need more than {2 * (teeth + sidebands)} "
            f"samples per revolution, got {n_samples}. Set theta_s = 2 * np.pi / "
            f"{8 * (teeth + sidebands)} or less."
        )
    harmonics = teeth * np.arange(1, (highest - sidebands) // teeth + 1)
    return (harmonics[:, np.newaxis] + np.arange(-sidebands, sidebands + 1)).ravel()


def residual_signal(
    average: ArrayLike, teeth: int, *, sidebands: int = 0, shaft_orders: int = 2
) -> Array:
    """Remove the regular meshing components from a time-synchronous average [1]_.

    Parameters
    ----------
    average : array-like of shape (n_samples,)
        One revolution, in any unit U.
    teeth : int
        Teeth of the gear.
    sidebands : int
        0: residual signal, without the harmonics of the mesh. 1: difference signal, also without
        the first sidebands on either side.
    shaft_orders : int
        Number of harmonics of the shaft that are removed as well, besides the mean.

    Returns
    -------
    ndarray of shape (n_samples,)
        What is left [U].

    References
    ----------
    .. [1] Zakrajsek, Townsend and Decker, An analysis of gear fault detection methods as applied
       to pitting fatigue failure data, NASA TM-105950 (1993).

    Examples
    --------
    >>> angle = 2 * np.pi * np.arange(64) / 64
    >>> average = np.cos(8 * angle) + 0.1 * np.cos(9 * angle) + 0.01 * np.cos(11 * angle)
    >>> residual, difference = (residual_signal(average, 8, sidebands=k) for k in (0, 1))
    >>> [round(float(signal.max()), 6) for signal in (residual, difference)]
    [0.11, 0.01]
    """
    x = check_signal(average, "average", min_length=8).astype(np.float64)
    spectrum = np.fft.rfft(x)
    spectrum[: check_count(shaft_orders, "shaft_orders", at_least=0) + 1] = 0
    spectrum[mesh_orders(teeth, len(x), sidebands=sidebands)] = 0
    return np.fft.irfft(spectrum, len(x))


def fm0(average: ArrayLike, teeth: int) -> float:
    """Return FM0: peak-to-peak value over the sum of the amplitudes of the mesh harmonics [1]_.

    References
    ----------
    .. [1] Stewart, Some useful data analysis techniques for gearbox diagnostics, University of
       Southampton, MHM/R/10/77 (1977); NASA TM-105950.

    Examples
    --------
    >>> angle = 2 * np.pi * np.arange(64) / 64
    >>> round(fm0(3 * np.cos(8 * angle), 8), 6)
    2.0
    """
    x = check_signal(average, "average", min_length=8).astype(np.float64)
    amplitudes = np.abs(np.fft.rfft(x)) * 2 / len(x)
    return float(np.ptp(x) / np.maximum(amplitudes[mesh_orders(teeth, len(x))].sum(), _TINY))


def normalized_moment(signal: ArrayLike, order: int) -> float:
    """Return a central moment over that power of the variance: 4 gives FM4, and 6 gives M6A [1]_.

    Applied to the difference signal, which is noise for a gear without fault: 3 and 15 then.

    References
    ----------
    .. [1] Martin, Statistical moment analysis as a surface damage indicator, AGARD CP-448 (1989).

    Examples
    --------
    >>> normalized_moment([1.0, -1.0, 1.0, -1.0], 4)
    1.0
    """
    x = check_signal(signal, "signal").astype(np.float64)
    x = x - x.mean()
    return float(np.mean(x**order) / np.maximum(np.mean(x**2), _TINY) ** (order / 2))


def na4(residuals: Sequence[ArrayLike]) -> Array:
    """Return NA4 of each of several runs of one gear, in order of time [1]_.

    The fourth moment of a residual signal over the square of its variance averaged over the runs
    so far, so that NA4, unlike FM4, keeps growing while damage spreads over the teeth.

    Parameters
    ----------
    residuals : sequence of array-like of shape (n_samples,)
        Residual signals, the oldest first. (Of the envelope of the mesh, this is NB4.)

    Returns
    -------
    ndarray of shape (n_runs,)
        About 3 for a gear without fault.

    References
    ----------
    .. [1] Zakrajsek, An investigation of gear mesh failure prediction techniques, NASA TM-102340
       (1989); NASA TM-105950 for the run ensemble.

    Examples
    --------
    >>> na4([[1.0, -1.0, 1.0, -1.0], [2.0, -2.0, 2.0, -2.0]]).round(2).tolist()
    [1.0, 2.56]
    """
    runs = [check_signal(run, "a residual signal").astype(np.float64) for run in residuals]
    centred = [run - run.mean() for run in runs]
    variances = np.array([np.mean(run**2) for run in centred])
    ensemble = np.cumsum(variances) / np.arange(1, len(runs) + 1)
    fourth = np.array([np.mean(run**4) for run in centred])
    return fourth / np.maximum(ensemble, _TINY) ** 2


def mesh_envelope(average: ArrayLike, teeth: int) -> Array:
    """Return the envelope of the band of ± half the mesh order around the mesh order.

    Parameters
    ----------
    average : array-like of shape (n_samples,)
        One revolution, in any unit U.
    teeth : int
        Teeth of the gear.

    Returns
    -------
    ndarray of shape (n_samples,)
        Envelope [U]; constant for a gear without fault.

    Examples
    --------
    >>> angle = 2 * np.pi * np.arange(64) / 64
    >>> envelope = mesh_envelope((2 + np.cos(angle)) * np.cos(8 * angle), 8)
    >>> np.allclose(envelope, 2 + np.cos(angle))
    True
    """
    x = check_signal(average, "average", min_length=8).astype(np.float64)
    mesh_orders(teeth, len(x))
    spectrum = np.zeros(len(x), complex)
    low, high = teeth - teeth // 2, min(teeth + teeth // 2, (len(x) - 1) // 2)
    spectrum[low : high + 1] = 2 * np.fft.rfft(x)[low : high + 1]
    return np.abs(np.fft.ifft(spectrum))


def sideband_level(average: ArrayLike, teeth: int) -> float:
    """Return the sum of the amplitudes of the first sidebands of the mesh over the RMS.

    Examples
    --------
    >>> angle = 2 * np.pi * np.arange(64) / 64
    >>> round(sideband_level((1 + 0.2 * np.cos(angle)) * np.cos(8 * angle), 8), 4)
    0.2801
    """
    x = check_signal(average, "average", min_length=8).astype(np.float64)
    mesh_orders(teeth, len(x), sidebands=1)
    x = x - x.mean()
    amplitudes = np.abs(np.fft.rfft(x)) * 2 / len(x)
    level = amplitudes[teeth - 1] + amplitudes[teeth + 1]
    return float(level / np.maximum(np.sqrt(np.mean(x**2)), _TINY))


_TINY = (
    np.finfo(np.float64).tiny ** 0.25
)  # of a signal without power; its square must not underflow to 0
