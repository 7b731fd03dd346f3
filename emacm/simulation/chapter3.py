"""The signals of chapter 3 of the thesis: a current at varying speed, healthy or with a defect."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_choice, check_count, check_number
from emacm.recordings.recording import Recording

CHAPTER3_ORDERS: Mapping[str, float | None] = {"healthy": None, "defect 1": 3.125, "defect 2": 10.5}


def chapter3_recording(
    label: str = "healthy",
    run: int = 0,
    *,
    sigma: float = 0.25,
    seed: int = 0,
    duration: float = 2.048,
    speed_frequency: float = 5.0,
    supply_amplitude: float = 0.1,
    defect_orders: Mapping[str, float | None] = CHAPTER3_ORDERS,
) -> Recording:
    """Simulate one run of the simulated motor current of the thesis [1]_.

    The motor turns in one direction, between standstill and 20 rev/s, and is sampled at 2 kHz; a
    defect has 0.1 A. All defaults are the published values. The figures show one second; the
    spectra need 4096 samples, that is, 2.048 s.

    Parameters
    ----------
    label : str
        One of the keys of `defect_orders`.
    run : int
        Number of the run. Runs differ only in their noise.
    sigma : float
        Standard deviation of the noise [A]. Eq. (3.6) states N(0, .25), which in the notation of
        the thesis is a variance (sigma 0.5), but its results correspond to 0.25.
    seed : int
        Seed of the noise. The same seed, label and run give the same recording.
    duration : float
        Length of the recording [s].
    speed_frequency : float
        Frequency of the speed variation [Hz].
    supply_amplitude : float
        Amplitude of the component of 100 Hz [A].
    defect_orders : mapping of str to float or None
        Labels and the orders of their defects; None for no defect.

    Returns
    -------
    Recording
        Channel "current" [A], and the speed of the shaft; `meta` contains label, run, severity
        (1; 0 without defect) and orders, the true order of each fault.

    Raises
    ------
    TypeError, ValueError
        If a parameter is invalid.

    References
    ----------
    .. [1] Chirico, Eqs. (3.1) to (3.6).

    Examples
    --------
    >>> chapter3_recording("defect 1", run=7).meta["orders"]
    {'defect 1': (3.125,)}
    """
    check_choice(label, "label", tuple(defect_orders))
    fs, mean_speed = 2000.0, 20 * np.pi  # Hz, rad/s
    times = np.arange(round(check_number(duration, "duration", above=0, unit="s") * fs)) / fs
    omega = 2 * np.pi * check_number(speed_frequency, "speed_frequency", above=0, unit="Hz")
    # Rounding must not make the speed negative where it reaches zero: that would be a stroke.
    velocity = np.maximum(mean_speed * (1 + np.sin(omega * times)), 0.0)  # Eq. (3.1)
    angle = mean_speed * times - mean_speed / omega * np.cos(omega * times)  # Eq. (3.2)
    current = 5.0 * np.sin(6 * angle)  # Eq. (3.4)
    current += supply_amplitude * np.sin(2 * np.pi * 100 * times)
    order = defect_orders[label]
    if order is not None:
        current += 0.1 * np.sin(order * angle)  # Eq. (3.5)
    # The label, not its position: another label must not change the noise of this one.
    key = (zlib.crc32(label.encode()), run)
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
    # Eq. (3.6)
    current += check_number(sigma, "sigma", at_least=0, unit="A") * rng.standard_normal(len(times))
    orders = {} if order is None else {label: (order,)}
    meta = {"label": label, "run": run, "severity": float(len(orders)), "orders": orders}
    return Recording({"current": current}, fs, velocity=velocity, meta=meta)


def chapter3_recordings(
    n_runs: int = 40,
    *,
    defect_orders: Mapping[str, float | None] = CHAPTER3_ORDERS,
    **constants: Any,
) -> tuple[list[Recording], NDArray[np.str_]]:
    """Simulate the runs of all classes of chapter 3 of the thesis.

    Parameters
    ----------
    n_runs : int
        Runs of each class. The first runs do not depend on their number.
    defect_orders, **constants
        As for `chapter3_recording`.

    Returns
    -------
    recordings : list of Recording
        ``len(defect_orders) * n_runs`` recordings, class by class.
    labels : ndarray of str
        Class of each.

    Raises
    ------
    TypeError, ValueError
        If a parameter is invalid.

    Examples
    --------
    >>> recordings, labels = chapter3_recordings(2)
    >>> labels.tolist()
    ['healthy', 'healthy', 'defect 1', 'defect 1', 'defect 2', 'defect 2']
    """
    recordings = [
        chapter3_recording(label, run, defect_orders=defect_orders, **constants)
        for label in defect_orders
        for run in range(check_count(n_runs, "n_runs"))
    ]
    return recordings, np.array([recording.meta["label"] for recording in recordings])
