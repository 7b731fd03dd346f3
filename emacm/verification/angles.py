"""Computed order tracking: resampling over the angle of the shaft."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.orders.order_psd import OrderPSD
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


def speed_variation() -> dict[str, float]:
    """Resample a tone that is locked to a shaft whose speed varies by half a percent."""
    time = np.arange(100_000) / 10_000
    angle = 2 * np.pi * 20 * time + (1 - np.cos(0.6 * np.pi * time)) / 3
    recording = Recording({"x": 3 * np.sin(27 * angle)}, 10_000, angle=angle)
    orders, spectrum = _spectrum(recording)
    return {"order": orders[spectrum.argmax()], "power": spectrum.max()}


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


def interpolation() -> dict[str, float]:
    """Interpolate at four samples per cycle; the loss is the transform of the kernel."""
    kinds = ("linear", "cubic")
    return {
        kind: _level(50, 4000, 20.0, 128, antialias=False, interpolation=kind) for kind in kinds
    }


def noise_floor(*, fs: int = 48_000, speed: float = 47.3) -> dict[str, float]:
    """Resample white noise at `speed` revolutions per second."""
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
