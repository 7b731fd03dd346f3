"""Known answers of resampling, spectra and lines of faults."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
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
from emacm.resampling.order_resampler import OrderResampler


def run_up() -> dict[str, float]:
    """Resample sin(6 theta) at a speed of 100 t rad/s, Figs. 2.6 and 2.7 of the thesis."""
    time = np.arange(501) / 1000
    signal = np.sin(300 * time**2)  # Eqs. (2.5), (2.11)
    recording = Recording({"x": signal}, 1000, velocity=100 * time)
    resampler = OrderResampler(2 * np.pi / 60, interpolation="linear", antialias=False)
    psd = OrderPSD(n_per_segment=256, window="boxcar", short="pad")
    (spectrum,) = psd.fit_transform(resampler.fit_transform([recording]))
    return {
        "order": psd.orders_[spectrum.argmax()],
        "power": spectrum.sum() * psd.order_step_,
        "revolutions": resampler.quality([recording])["revolutions"].iloc[0],
    }


def reversals() -> dict[str, float]:
    """Cut a motion forth and back into strokes, with a line in the forward ones only."""
    time = np.arange(30_000) / 10_000
    angle, forward = 48 * (1 - np.cos(np.pi * time)), np.sin(np.pi * time) > 0
    recording = Recording({"x": np.where(forward, np.sin(9 * angle), 0)}, 10_000, angle=angle)
    (over_angle,) = OrderResampler().fit_transform([recording])
    psd = OrderPSD(8, by_direction=True, scaling="spectrum").set_output(transform="pandas")
    powers = psd.fit_transform([over_angle]).iloc[0]
    reverse = powers.filter(like="x-@").max()
    return {"strokes": len(over_angle.strokes), "forward": powers["x+@9"], "reverse": reverse}


def pass_band() -> dict[str, float]:
    """Resample tones below the highest order."""
    return {f"order {k:g}": _level(k, 10_000, 20.0, 128) for k in (1.0, 13.5, 49.375)}


def aliasing() -> dict[str, float]:
    """Resample a tone at order 130.5 at 100 angles per revolution: its image is order 30.5."""
    levels = {
        "filtered": _level(130.5, 48_000, 10.0, 100, read_at=30.5),
        "unfiltered": _level(130.5, 48_000, 10.0, 100, read_at=30.5, antialias=False),
    }
    return {name: 10 ** (level / 20) for name, level in levels.items()}


def noise_floor() -> dict[str, float]:
    """Resample white noise."""
    fs, speed = 48_000, 47.3  # revolutions per second
    noise = np.random.default_rng(0).standard_normal(4 * fs)
    recording = Recording({"x": noise}, fs, velocity=2 * np.pi * speed)
    found = {}
    for name, antialias in (("filtered", True), ("unfiltered", False)):
        options: dict[str, Any] = {"antialias": antialias, "interpolation": "linear"}
        orders, psd = _spectrum(recording, "density", theta_s=2 * np.pi / 100, **options)
        floor = psd[(orders > 1) & (orders < 39)].mean()
        found[name] = 10 * np.log10(floor / (2 * speed / fs))
    return found


def _level(
    order: float, fs: int, speed: float, n_angles: int, *, read_at: float = np.nan, **options: Any
) -> float:
    """Return the level that a tone has at `read_at`, or at the highest line [dB re its power]."""
    turns = speed * np.arange(3 * fs) / fs
    signal = np.sin(order * 2 * np.pi * turns + 0.3)
    recording = Recording({"x": signal}, fs, velocity=2 * np.pi * speed)
    orders, spectrum = _spectrum(recording, theta_s=2 * np.pi / n_angles, **options)
    power = spectrum.max() if np.isnan(read_at) else spectrum[np.abs(orders - read_at).argmin()]
    return float(10 * np.log10(power / 0.5))


def _spectrum(
    recording: Recording, scaling: str = "spectrum", **resampling: Any
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return orders and the spectrum of one recording."""
    psd = OrderPSD(8, scaling=scaling)
    (spectrum,) = psd.fit_transform(OrderResampler(**resampling).fit_transform([recording]))
    return psd.orders_, spectrum


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
