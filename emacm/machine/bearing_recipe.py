"""The pipeline from vibration to the levels of the faults of a machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from sklearn.pipeline import Pipeline, make_pipeline

from emacm._checks import check_number
from emacm.envelopes.envelope_detector import EnvelopeDetector
from emacm.envelopes.prewhitening import CepstralPrewhitening
from emacm.machine.fault_lines import FaultLines
from emacm.machine.fault_orders import FaultSeries, Parts, fault_series
from emacm.orders.order_psd import OrderPSD
from emacm.resampling.order_resampler import OrderResampler


def bearing_recipe(
    parts: Parts,
    *,
    harmonics: int = 3,
    slip: float = 0.02,
    revolutions: float = 25,
    min_speed: float = 0.0,
    channels: Sequence[str] | None = None,
    classifier: Any = None,
    n_jobs: int | None = None,
) -> Pipeline:
    """Return an unfitted pipeline from recordings to the level of each fault [dB].

    The signals are prewhitened, so that no band has to be chosen; the envelope of the whole band
    is resampled over the shaft angle, and the lines of each fault are measured above their local
    background. The features need no training and do not depend on gain, resonances or slip, so
    that a classifier can be trained on one machine and applied to another one with other bearings.

    Parameters
    ----------
    parts : part, or sequence of parts
        `Bearing`, `Gear` and so on, or mappings of fault names to orders.
    harmonics : int
        Number of lines of each fault.
    slip : float
        Largest deviation of rolling elements from the predicted orders, as a fraction.
    revolutions : float
        Length of a segment of the spectra. 25 revolutions separate the lines of most bearings; a
        recording must be at least as long.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s].
    channels : sequence of str, optional
        Vibration channels, in this order. Default: all.
    classifier : estimator, optional
        Last step, such as `CostSensitiveGaussianBayes`. Default: none, so that `transform` returns
        the levels.
    n_jobs : int, optional
        Number of recordings processed in parallel.

    Returns
    -------
    Pipeline
        Steps "cepstralprewhitening", "envelopedetector", "orderresampler", "orderpsd",
        "faultlines" and, if given, "classifier". X is a list of `Recording`; the columns are named
        ``channel@BPFI``.

    Raises
    ------
    TypeError, ValueError
        If a parameter is invalid.

    See Also
    --------
    emacm.find_faults : Without training data.
    emacm.actuator_recipe : For strokes of an actuator.

    Notes
    -----
    The envelope is its amplitude (not squared), from 1/32 to 15/32 of the sampling rate. These
    choices were made on the drive end of the CWRU test rig and on the MFPT recordings;
    ``benchmarks/bearings.py`` evaluates them.

    Examples
    --------
    >>> from emacm import Bearing, bearing_recipe
    >>> recipe = bearing_recipe(Bearing(9, 7.94, 39.04))
    >>> [name for name, _ in recipe.steps][:3]
    ['cepstralprewhitening', 'envelopedetector', 'orderresampler']
    """
    series = fault_series(parts, harmonics)
    spectra = envelope_spectra(series, slip, revolutions, channels)
    spectra.set_params(orderresampler__min_speed=min_speed, orderpsd__n_jobs=n_jobs)
    lines = FaultLines(parts, harmonics=harmonics, slip=slip)
    last = [] if classifier is None else [("classifier", classifier)]
    return Pipeline([*spectra.steps, ("faultlines", lines), *last])


def envelope_spectra(
    series: Sequence[FaultSeries], slip: float, revolutions: float = 25, channels: Any = None
) -> Pipeline:
    """Return the steps of `bearing_recipe` to envelope spectra that hold some series of lines."""
    check_number(slip, "slip", at_least=0, below=0.2)
    highest = max(order for fault in series for order in fault.orders)
    top = round(highest * (1 + slip), 1) + 0.5  # with the background of the last line
    return make_pipeline(
        CepstralPrewhitening(channels=channels),
        EnvelopeDetector("full", channels=channels, squared=False),
        OrderResampler(2 * np.pi / (2.6 * top), channels=channels),
        OrderPSD(revolutions, max_order=top),
    )
