"""Documented examples of order analysis and gear diagnosis, made again from their parameters.

The examples are those of the documentation of MATLAB's Signal Processing and Predictive
Maintenance Toolboxes. Their signals are synthetic and are made here from the published numbers;
each expected value follows from these numbers, and must be found within 1 %.
"""

import numpy as np
import pytest

from emacm import (
    Bearing,
    BinTransformer,
    EnvelopeDetector,
    Gear,
    GearIndicators,
    OrderPSD,
    OrderResampler,
    Recording,
    fault_orders,
    order_bands,
)

TURN = 2 * np.pi
WITHIN = 0.01


def spectrum(recording, revolutions, *, samples=64, ratio=1.0, **options):
    """Return orders, and powers of tones (amplitude²/2) of the first channel."""
    resampler = OrderResampler(TURN / samples, ratio=ratio, min_speed=1e-3)
    over_angle = resampler.fit_transform([recording])
    psd = OrderPSD(revolutions, scaling="spectrum", window="flattop", **options)
    powers = psd.fit_transform(over_angle)[0]
    orders = np.arange(len(powers)) / revolutions
    return orders, powers


def peak(orders, powers, near, width=0.3):
    """Return order and amplitude of the highest line near an order."""
    close = np.flatnonzero(np.abs(orders - near) <= width)
    top = close[np.argmax(powers[close])]
    return orders[top], np.sqrt(2 * powers[top])


def run_up(seconds, fs, start_rpm, stop_rpm):
    """Return times, speed [rad/s] and angle [rad] of a speed that rises evenly."""
    times = np.arange(int(seconds * fs)) / fs
    start, stop = start_rpm * TURN / 60, stop_rpm * TURN / 60
    speed = start + (stop - start) * times / seconds
    angle = start * times + (stop - start) * times**2 / (2 * seconds)
    return times, speed, angle


def test_order_spectrum_of_a_chirp_with_four_orders():
    # orderspectrum: 600 Hz, 5 s, shaft 10 to 40 rev/s; orders 1, 0.5, 4, 6; amplitudes 1, 0.5,
    # sqrt(2), 2.
    _, speed, angle = run_up(5, 600, 600, 2400)
    lines = {1: 1.0, 0.5: 0.5, 4: np.sqrt(2), 6: 2.0}
    signal = sum(size * np.cos(order * angle) for order, size in lines.items())
    # 15 samples per revolution at the highest speed: orders up to 7.5.
    found = spectrum(Recording({"x": signal}, 600, velocity=speed), 20)
    for order, size in lines.items():
        at, amplitude = peak(*found, order)
        assert at == pytest.approx(order, rel=WITHIN)
        assert amplitude == pytest.approx(size, rel=WITHIN)


def test_mesh_frequencies_of_a_gear_pair():
    # gearMeshFaultBands(20, 8, 42): input 20, output 3.8095, assembly phase 80, mesh 160.
    gear = Gear(8, 42, ratio=20.0)
    orders = fault_orders(gear)["order"]
    expected = {"pinion": 20, "wheel": 3.8095, "phase": 80, "mesh": 160}
    for name, value in expected.items():
        assert orders[name] == pytest.approx(value, rel=1e-4)


def test_vibration_of_a_gearbox_with_a_damaged_tooth():
    # Vibration Analysis of Rotating Machinery: pinion 13 teeth at 22.5 Hz, gear 35 teeth at
    # 8.357 Hz, mesh 292.5 Hz, 20 kHz, 20 s; amplitudes 0.4, 0.2, 1; a local fault on the gear
    # excites 2 kHz once per turn of the gear; another one on the pinion once per turn of it.
    fs, pinion_speed = 20_000, 22.5
    gear = Gear(13, 35)
    times = np.arange(20 * fs) / fs
    wheel_speed = pinion_speed * gear.output_ratio
    mesh = pinion_speed * 13
    assert wheel_speed == pytest.approx(8.357, abs=5e-4)
    assert mesh == pytest.approx(292.5)
    rng = np.random.default_rng(0)
    rows = 0.4 * np.sin(TURN * pinion_speed * times) + 0.2 * np.sin(TURN * wheel_speed * times)
    rows += np.sin(TURN * mesh * times)
    impact_times = np.arange(0, 8e-3, 1 / fs)
    impact = np.sin(TURN * 2000 * impact_times) * np.kaiser(len(impact_times), 40)
    comb = np.zeros(len(times))
    comb[(np.arange(0, times[-1], 1 / wheel_speed) * fs).astype(int)] = 2
    rows += np.convolve(comb, impact)[: len(times)] + 0.2 * rng.normal(size=len(times))
    recording = Recording({"case": rows}, fs, angle=TURN * pinion_speed * times)
    found = spectrum(recording, 70, samples=48)
    orders = fault_orders(gear)["order"]
    for name, size in (("pinion", 0.4), ("wheel", 0.2), ("mesh", 1.0)):
        at, amplitude = peak(*found, orders[name], width=0.05)
        assert at * pinion_speed == pytest.approx(pinion_speed * orders[name], rel=WITHIN)
        assert amplitude == pytest.approx(size, rel=WITHIN)
    envelope = EnvelopeDetector((1700, 2300)).fit_transform([recording])
    at_orders, powers = spectrum(envelope[0], 70, samples=48)
    first = (at_orders > 0.2) & (at_orders < 0.7)
    strongest = at_orders[first][np.argmax(powers[first])]
    assert strongest * pinion_speed == pytest.approx(wheel_speed, rel=WITHIN)


def test_envelope_spectrum_of_a_bearing_with_an_inner_race_fault():
    # envspectrum: rollers 8, 12 mm on a pitch of 48 mm, contact angle 0 here; 25 rev/s; impacts
    # at BPFI excite a 3 kHz resonance, 20 kHz.
    fs, speed = 20_000, 25.0
    bearing = Bearing(8, 12.0, 48.0)
    bpfi = fault_orders(bearing)["order"]["BPFI"]
    assert bpfi * speed == pytest.approx(125.0)  # 8/2 * 25 * (1 + 12/48)
    times = np.arange(5 * fs) / fs
    comb = np.zeros(len(times))
    comb[np.rint(np.arange(0, times[-1], 1 / (bpfi * speed)) * fs).astype(int)] = 1
    decay = np.exp(-800 * times[:400]) * np.sin(TURN * 3000 * times[:400])
    signal = np.convolve(comb, decay)[: len(times)]
    signal += 0.02 * np.random.default_rng(1).normal(size=len(times))
    recording = Recording({"case": signal}, fs, angle=TURN * speed * times)
    envelope = EnvelopeDetector((2000, 4000)).fit_transform([recording])
    orders, powers = spectrum(envelope[0], 25)
    inner = orders > 0.5
    strongest = orders[inner][np.argmax(powers[inner])]
    assert strongest * speed == pytest.approx(125.0, rel=WITHIN)


def test_power_in_the_fault_bands_of_a_bearing():
    # faultBandMetrics: the power of a tone in its fault band is half its amplitude squared.
    bands = order_bands(fault_orders(Bearing(10, 10.0, 60.0)), on_overlap="keep")
    fs, speed = 5000, 30.0
    times = np.arange(10 * fs) / fs
    angle = TURN * speed * times
    low, high = bands["BPFO"]
    outer = (low + high) / 2
    signal = 0.7 * np.cos(outer * angle) + 0.1 * np.random.default_rng(2).normal(size=len(times))
    rows = OrderResampler(TURN / 64).fit_transform([Recording({"case": signal}, fs, angle=angle)])
    table = OrderPSD(50).set_output(transform="pandas").fit_transform(rows)
    power = BinTransformer(edges=bands).set_output(transform="pandas").fit_transform(table)
    assert outer == pytest.approx(10 / 2 * (1 - 1 / 6), rel=1e-9)
    assert power["case@BPFO"][0] == pytest.approx(0.7**2 / 2, rel=WITHIN)


def test_gear_condition_metrics_of_a_damaged_tooth():
    # gearConditionMetrics: known values of the definitions. FM0 of a mesh tone: 2; one tooth of 20
    # with a burst of a sine over one of n teeth: the kurtosis of the burst is 3/2 n, and the mesh
    # harmonics and sidebands that are removed lower FM4 (the exact value is that of the FFT).
    samples, teeth = 400, 20
    angle = TURN * np.arange(samples) / samples
    turns = 30
    long = np.tile(angle, turns) + TURN * np.repeat(np.arange(turns), samples)
    fs = samples * 10
    healthy = np.cos(teeth * long)
    at_tooth = np.mod(long, TURN) < TURN / teeth
    damaged = healthy + np.where(at_tooth, 0.3 * np.sin(3 * teeth * long + 0.5), 0.0)
    rows = OrderResampler(TURN / 1000).fit_transform(
        [Recording({"case": x}, fs, angle=long) for x in (healthy, damaged)]
    )
    names = GearIndicators(teeth, by_direction=False).set_output(transform="pandas")
    found = names.fit(rows[:1]).transform(rows)
    assert found["case:FM0"][0] == pytest.approx(2, rel=WITHIN)
    burst = np.where(at_tooth[:samples], 0.3 * np.sin(3 * teeth * angle + 0.5), 0.0)
    assert np.mean(burst**4) / np.mean(burst**2) ** 2 == pytest.approx(1.5 * teeth, rel=WITHIN)
    orders = np.fft.fft(burst)
    away = np.abs(np.fft.fftfreq(samples, 1 / samples))
    regular = np.isin(away % teeth, (0, 1, teeth - 1)) | (away <= 2)
    left = np.fft.ifft(np.where(regular, 0, orders)).real
    expected = np.mean(left**4) / np.mean(left**2) ** 2
    assert expected > 15
    assert found["case:FM4"][1] == pytest.approx(expected, rel=WITHIN)
