"""Order spectra, order bins, envelopes, and the orders of faults."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import signal as filters
from scipy.integrate import trapezoid

from emacm.envelopes.envelope_detector import EnvelopeDetector
from emacm.envelopes.kurtogram import spectral_kurtosis
from emacm.machine.fault_orders import fault_orders
from emacm.machine.gears import Gear, PlanetaryGear
from emacm.machine.motors import Motor
from emacm.machine.rolling import Bearing
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD
from emacm.orders.welch import order_psd
from emacm.recordings.recording import Recording


def sine_of_the_thesis() -> dict[str, float]:
    """Read the spectrum of 40 Hz at 640 Hz, 32 samples, Fig. 2.5 of the thesis."""
    sine = np.sin(2 * np.pi * 40 * np.arange(32) / 640)
    options: dict[str, Any] = {"n_per_segment": 32, "window": "boxcar"}
    hertz, psd = order_psd(sine, 640, **options)  # samples per second: hertz in place of orders
    lines, power = order_psd(sine, 1, scaling="spectrum", **options)
    found = {"frequency": hertz[psd.argmax()], "density": psd.max()}
    return found | {"normalised": lines[power.argmax()], "power": power.max()}


def welchs_method() -> dict[str, float]:
    """Compare spectra with those of SciPy, and their integral with the mean square."""
    noise = np.random.default_rng(1).standard_normal(64 * 400)
    tone = 3 * np.sin(7 * 2 * np.pi * np.arange(64 * 200) / 64)
    _, psd = order_psd(noise, 64, revolutions=4)
    _, of_scipy = filters.welch(noise, 64, nperseg=256, detrend="constant")
    whole: dict[str, Any] = {"n_per_segment": len(noise), "window": "boxcar", "detrend": None}
    orders, lines = order_psd(noise, 64, **whole)
    powers = {
        window: order_psd(tone, 64, window=window, scaling="spectrum")[1].max()
        for window in ("hann", "flattop")
    }
    return powers | {
        "scipy": np.abs(psd - of_scipy).max() / of_scipy.max(),
        "parseval": lines.sum() * orders[1] / np.mean(noise**2),
        "noise": 25 * psd[4:-4].mean(),
    }


def order_bins() -> dict[str, float]:
    """Compare bins with the integrals between their edges."""
    ramp = np.arange(0, 10.01, 0.061)[np.newaxis]  # the order step of chapter 3
    notch = BinTransformer(1, max_order=10, order_step=0.061, stop_bands=((5.6, 6.4),))
    bins = notch.fit_transform(ramp)[0]
    flat = BinTransformer(1, max_order=10, order_step=0.5).fit_transform(np.ones((1, 21)))
    noise = np.random.default_rng(2).standard_normal((1, 2048))
    psd = OrderPSD(32, theta_s=2 * np.pi / 64)
    spectrum = psd.fit_transform(noise)
    narrow = BinTransformer(0.3, max_order=32).fit_transform(spectrum)
    integral = trapezoid(np.asarray(spectrum)[0], psd.orders_)
    found = {"stop band": bins[5], "sum": bins.sum()}
    return found | {"flat": flat.min(), "noise": narrow.sum() / integral}


def envelopes() -> dict[str, float]:
    """Detect the envelope of a modulated tone, and compute the spectral kurtosis of a tone."""
    time = np.arange(40_000) / 20_000
    modulated = (1 + 0.5 * np.cos(2 * np.pi * 30 * time)) * np.sin(2 * np.pi * 4000 * time)
    recording = Recording({"x": modulated}, 20_000, velocity=2 * np.pi * 10)
    (envelope,) = EnvelopeDetector((3000, 5000)).fit_transform([recording])
    squared = np.asarray(envelope.signals["x"])[2000:-2000]
    _, powers = order_psd(squared, 20_000, revolutions=1, scaling="spectrum")  # lines of 1 Hz
    hertz, kurtosis = spectral_kurtosis(np.sin(2 * np.pi * 2500 * time), 20_000)
    found = {"line": powers[30], "mean": squared.mean()}
    return found | {"kurtosis": kurtosis[np.abs(hertz - 2500).argmin()]}


def orders_of_faults() -> dict[str, float]:
    """Compare the orders of bearings, gears and motors with published ones."""
    bearing = fault_orders(Bearing(9, 7.94, 39.04))["order"]
    current = fault_orders(Motor(6), {"BPFI": 6.123}, signal="current")["order"]
    return bearing.to_dict() | {
        "wheel": 20 * fault_orders(Gear(8, 42))["order"]["wheel"],
        "planetary": PlanetaryGear(21, 99, 3, 39, driven_by="carrier").output_ratio,
        "current": current["supply+BPFI"],
    }
