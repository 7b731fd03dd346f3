"""A healthy unit has lines of its rolling elements, an imperfect resolver, and warms up."""

import numpy as np
import pytest

from emacm.simulation.actuator import Actuator
from emacm.simulation.bench import LaboratoryBench
from emacm.simulation.faults import BEARING, HEALTHY_ORDERS, SCREW
from emacm.simulation.imperfections import (
    draw_imperfections,
    healthy_lines,
    resolver_error,
    warmth,
)
from emacm.simulation.mechanics import Motion
from emacm.simulation.motor import shaft_torques
from emacm.simulation.sensors import interference, measured, resolver_angle

NOMINAL = draw_imperfections(np.random.default_rng(0), spread=0)
ARCMIN = np.pi / 180 / 60
TURNS = 2 * np.pi * np.arange(20_000) / 1000  # 20 revolutions


def line(signal, order, turns):
    """Complex amplitude at an order over a whole number of turns."""
    return 2 * np.mean(signal * np.exp(-1j * order * turns))


def test_the_error_of_the_resolver_has_orders_1_2_and_12():
    error, slope = resolver_error(TURNS, Actuator(resolver_error=4.5), NOMINAL)
    amplitudes = np.abs(np.fft.rfft(error)) / 10_000
    assert np.flatnonzero(amplitudes > 1e-12).tolist() == [20, 40, 240]
    assert amplitudes[[20, 40, 240]] == pytest.approx([4.5 * ARCMIN, 4.5 * ARCMIN, 1.5 * ARCMIN])
    assert slope[1:-1] == pytest.approx(np.gradient(error, TURNS)[1:-1], abs=2e-5)


def test_the_measured_angle_has_the_error_of_the_resolver():
    error, _ = resolver_error(TURNS, Actuator(), NOMINAL)
    error_read = resolver_angle(TURNS, np.random.default_rng(1), error) - TURNS[::10]
    for order, arcmin in ((1, 3.0), (2, 3.0), (12, 1.0)):
        assert abs(line(error_read, order, TURNS[::10])) == pytest.approx(arcmin * ARCMIN, abs=8e-6)
    assert abs(line(error_read, 5, TURNS[::10])) < 8e-6  # noise: 5e-5 over 2000 samples


def test_usual_units_have_errors_of_some_arcmin():
    worst = []
    for unit in range(200):
        drawn = draw_imperfections(np.random.default_rng(unit))
        worst.append(np.abs(resolver_error(TURNS, Actuator(), drawn)[0]).max() / ARCMIN)
    assert 5 < np.median(worst) < 10


def test_the_velocity_contains_the_derivative_of_that_error():
    bench = LaboratoryBench(unit=2, duration=2.0, electrical_noise=0.0, run_spread=0.0)
    perfect = LaboratoryBench(
        unit=2,
        duration=2.0,
        electrical_noise=0.0,
        run_spread=0.0,
        actuator=Actuator(resolver_error=0.0),
    )
    with_error, without = (b.record(5).signals["velocity"].astype(float) for b in (bench, perfect))
    truth = bench.truth(5)
    _, slope = resolver_error(truth.torques.angle, truth.actuator, bench._imperfections)
    expected = (slope * truth.torques.velocity)[4800:]
    # 800 Hz pass orders up to 12 at 16 rev/s; both have the same noise.
    assert np.std(with_error - without) == pytest.approx(np.std(expected), rel=0.05)


def test_healthy_lines_are_those_of_bearing_and_screw():
    # At constant speed: 60 revolutions per second, slip below half a line over 2 s.
    fs = 48_000
    angle = 2 * np.pi * 60 * np.arange(4 * fs) / fs
    lines = healthy_lines(angle, NOMINAL, np.random.default_rng(3), fs)
    amplitudes = np.abs(np.fft.rfft(lines.force * np.hanning(len(angle))))
    orders = np.fft.rfftfreq(len(angle), 60 / fs)
    peaks = [orders[i] for i in np.argsort(amplitudes)[::-1][:40]]
    ratio = BEARING.ball_diameter / BEARING.pitch_diameter * np.cos(BEARING.contact_angle)
    bearing_order = BEARING.n_balls / 2 * (1 + ratio)
    for order in (bearing_order, 10 - bearing_order):  # BPFI, BPFO
        assert np.abs(np.array(peaks) - order).min() < 0.03
    assert HEALTHY_ORDERS["BPFI"] == pytest.approx(bearing_order)
    predicted = np.array([k * order for order in HEALTHY_ORDERS.values() for k in (1, 2)])
    away = np.min(np.abs(orders[:, np.newaxis] - predicted), axis=1)
    assert amplitudes[away > 0.5].max() < 0.01 * amplitudes.max()


def test_the_balls_of_the_screw_recirculate_in_the_torque():
    fs = 4000
    angle = 2 * np.pi * 20 * np.arange(8 * fs) / fs
    lines = healthy_lines(angle, NOMINAL, np.random.default_rng(4), fs)
    amplitudes = np.abs(np.fft.rfft(lines.torque * np.hanning(len(angle))))
    leading = np.fft.rfftfreq(len(angle), 20 / fs)[amplitudes.argmax()]
    ratio = SCREW.ball_diameter / SCREW.pitch_diameter * np.cos(SCREW.contact_angle)
    assert leading == pytest.approx(10 * (1 - ratio), abs=0.05)


def test_units_differ_in_their_lines_and_a_unit_keeps_them():
    shares = np.array([LaboratoryBench(unit=u)._imperfections.line_shares for u in range(30)])
    assert np.std(np.log(shares)) == pytest.approx(0.5, rel=0.2)
    same = LaboratoryBench(unit=3, faults="jam", duration=1.0)._imperfections
    assert np.array_equal(same.line_shares, shares[3])


def test_a_unit_warms_up_within_its_runs():
    values = [warmth(np.random.default_rng(5), run) for run in (1, 4, 9, 20, 60)]
    assert np.all(np.diff(values) > 0)
    assert 0 <= values[0] <= 0.5
    assert values[-1] == pytest.approx(1, abs=1e-3)


def test_friction_falls_with_temperature():
    bench = LaboratoryBench(unit=4, duration=0.05)
    viscous = [bench.truth(2, run).actuator.viscous for run in range(1, 31)]
    cold, warm = np.mean(viscous[:3]), np.mean(viscous[-10:])
    first = warmth(bench._rng("warmth", 2), 2)
    assert np.log(warm / cold) == pytest.approx(-0.4 * (0.97 - first), abs=0.06)
    steady = LaboratoryBench(unit=4, duration=0.05, run_spread=0.0)
    assert steady.truth(2, 30).actuator == steady.built


def test_friction_falls_within_a_recording():
    # Warmth 0.005 1/s; from cold to warm, viscous friction falls by 40 % and dry friction by 15 %.
    times = np.arange(101) / 10
    motion = Motion(times, 200 * times, np.full(101, 200.0), np.zeros(101))
    for constants, fallen in (({"viscous": 0.0}, 0.0075), ({"coulomb": 0.0}, 0.02)):
        actuator = Actuator(**constants)
        runs = [
            shaft_torques(motion, np.zeros(101), actuator, {}, {}, np.random.default_rng(0), 0, s)
            for s in (1.0, 0.0)
        ]
        drifting, steady = (run.friction for run in runs)
        assert drifting / steady == pytest.approx(1 - fallen * times / 10)


@pytest.mark.parametrize(("spread", "per_second"), [(1.0, 1e-5), (0.0, 0.0)])
def test_the_gain_of_the_lvdt_drifts_within_a_recording(spread, per_second):
    bench = LaboratoryBench(duration=20.0, fs=2000.0, cutoff=900.0, run_spread=spread)
    truth = bench.truth(5)
    kept = truth.times >= 0
    times, place, speed = truth.times[kept], truth.position[kept], truth.torques.velocity[kept]
    reading = bench.record(5).signals["lvdt"].astype(float)
    # The filters delay the reading: the speed is the third column.
    columns = np.stack([place, times * place, speed, np.ones_like(times)], axis=1)
    gain, change, *_ = np.linalg.lstsq(columns, reading, rcond=None)[0]
    assert change / gain == pytest.approx(per_second, abs=1e-6)


def test_the_accelerometer_is_mounted_again_every_five_runs():
    bench = LaboratoryBench(unit=6, duration=0.05)
    runs = [bench.truth(1, run).actuator for run in range(1, 16)]
    gains = [
        run.accelerometer_gain / np.exp(0.01 * warmth(bench._rng("warmth", 1), number))
        for number, run in enumerate(runs, start=1)
    ]
    blocks = np.array(gains).reshape(3, 5)
    assert np.ptp(blocks, axis=1) == pytest.approx(np.zeros(3), abs=1e-12)
    assert len(set(blocks[:, 0].round(9))) == 3


@pytest.mark.parametrize(("sensor", "cutoff"), [("lvdt", 250.0), ("velocity", 800.0)])
def test_a_demodulator_halves_the_power_at_its_bandwidth(sensor, cutoff):
    fs = 48_000
    times = np.arange(2 * fs) / fs
    for hertz in (cutoff / 10, cutoff, 4 * cutoff):
        # Digital: the axis is bent by the tangent.
        bent = np.tan(np.pi * hertz / fs) / np.tan(np.pi * cutoff / fs)
        gain = 1 / np.sqrt(1 + bent**4)
        tone = 2 * np.sin(2 * np.pi * hertz * times)
        out = measured(sensor, tone, np.random.default_rng(0), fs=fs, cutoff=15_000)
        amplitude = abs(line(out[fs:], 1, 2 * np.pi * hertz * times[fs:]))
        assert amplitude / 2 == pytest.approx(gain, rel=0.02)


def test_mains_and_carrier_are_fixed_in_time():
    bench = LaboratoryBench(unit=1, duration=3.0)
    for condition in (3, 5):
        lvdt = bench.record(condition).signals["lvdt"].astype(float) / 0.5  # V
        lvdt -= np.convolve(lvdt, np.ones(801) / 801, "same")  # the motion
        kept = lvdt[24_000:120_000]
        times = np.arange(len(kept)) / 48_000
        for hertz, volts in ((180.0, 4e-4), (10_000.0, 2e-3)):
            assert abs(line(kept, 1, 2 * np.pi * hertz * times)) == pytest.approx(volts, rel=0.15)


def test_lines_above_half_the_sampling_rate_are_left_out():
    slow = interference(np.arange(4000) / 400, np.random.default_rng(0))
    hertz = np.fft.rfftfreq(4000, 1 / 400)
    present = hertz[np.abs(np.fft.rfft(slow.mains)) > 1]
    assert present.tolist() == [60.0, 180.0]
    assert not slow.carrier.any()
