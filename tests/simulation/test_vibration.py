"""Forces grow as mechanics has it, and the housing rings at its modes."""

import numpy as np
import pytest

from emacm.simulation.actuator import PEAK_SPEED, Actuator
from emacm.simulation.faults import Passage
from emacm.simulation.motor import Torques
from emacm.simulation.vibration import GRAVITY, housing_acceleration, housing_force

FS = 48_000
TIMES = np.arange(FS) / FS
QUIET = Actuator(rolling_noise=0.0, unbalance=0.0)
NO_KNOCK = np.zeros(0, dtype=int)


def turning(speed, load=0.0, motor=0.0):
    zero = np.zeros(FS)
    constant = np.full(FS, speed)
    return Torques(zero + motor, zero + load, zero, zero, speed * TIMES, constant, zero)


def forced(torques, actuator=QUIET, faults=None, passages=None, knocks=NO_KNOCK, seed=0):
    rng = np.random.default_rng(seed)
    return housing_force(torques, actuator, faults or {}, passages or {}, knocks, rng, FS)


def struck(speed=100.0, severity=1.0, load=0.0):
    """Strikes of an evenly loaded outer ring, 100 in a second whatever the speed."""
    phase = 100 * TIMES + 0.5
    impacts = np.flatnonzero(np.diff(np.floor(phase))) + 1
    passage = Passage(phase, np.ones(FS), impacts, np.ones(len(impacts)))
    torques = turning(speed, load)
    return forced(torques, faults={"outer ring": severity}, passages={"outer ring": passage})


def test_unbalance_grows_with_the_square_of_the_speed():
    rotor = Actuator(rolling_noise=0.0, unbalance=1e-4)
    slow, fast = (np.abs(forced(turning(s), rotor)).max() for s in (100.0, 200.0))
    assert slow == pytest.approx(1e-4 * 100**2, rel=1e-3)
    assert fast == pytest.approx(4 * slow, rel=1e-3)


def test_rolling_noise_is_stated_at_peak_speed_and_grows_with_it():
    bearing = Actuator(unbalance=0.0, rolling_noise=10.0)
    full, half = (forced(turning(s), bearing).std() for s in (PEAK_SPEED, PEAK_SPEED / 2))
    assert full == pytest.approx(10 * np.sqrt(0.2), rel=0.02)
    assert half == pytest.approx(full / 2)


def test_rolling_noise_grows_with_load_and_lack_of_grease():
    bearing = Actuator(unbalance=0.0)
    free = forced(turning(100.0), bearing).std()
    assert forced(turning(100.0, load=5.0), bearing).std() > 1.2 * free
    dry = forced(turning(100.0), bearing, {"lubrication": 1.0}).std()
    assert dry == pytest.approx(3 * free)


def test_strikes_grow_in_proportion_to_severity_and_speed():
    whole = struck()
    assert np.allclose(struck(severity=0.5), 0.5 * whole)
    assert np.allclose(struck(speed=200.0), 2 * whole)


def test_strikes_grow_with_the_load():
    light, heavy = (np.abs(struck(load=load)).max() for load in (0.0, 10.478))
    # 10.478 N m is the torque of 3700 lbf at a lead of 0.1575 in: from a preload of a fifth to 1.2.
    assert heavy / light == pytest.approx(np.sqrt(6), rel=0.01)


def test_a_strike_carries_its_momentum_whatever_the_sampling():
    # 0.05 N s at severity 1 and peak speed, with preload alone; 20 % of scatter, log-normal.
    momentum = struck(speed=PEAK_SPEED).sum() / FS / 100
    expected = 0.05 * np.sqrt(0.2) * np.exp(0.02)
    assert momentum == pytest.approx(expected, rel=0.08)


def test_the_motor_pulls_at_twice_its_electrical_order():
    force = forced(turning(2 * np.pi * 10, motor=10.0))
    spectrum = np.abs(np.fft.rfft(force))
    assert spectrum.argmax() == 120  # Hz: order 12 of 10 revolutions a second


def test_an_eccentric_rotor_pulls_once_a_revolution_and_beside_order_12():
    force = forced(turning(2 * np.pi * 10), faults={"eccentricity": 1.0})
    spectrum = np.abs(np.fft.rfft(force))
    assert np.flatnonzero(spectrum > 0.1 * spectrum.max()).tolist() == [10, 110, 130]


def test_a_bad_cage_lets_the_rolling_noise_swell_at_its_order():
    force = forced(turning(2 * np.pi * 50), Actuator(unbalance=0.0), {"cage": 1.0})
    envelope = np.abs(np.fft.rfft(force**2 - np.mean(force**2)))[:100]
    assert envelope.argmax() == round(0.3877 * 50)


def test_lash_knocks_in_proportion_to_it():
    knocks = np.array([1000, 20_000])
    whole, half = (forced(turning(0.0), faults={"backlash": s}, knocks=knocks) for s in (1.0, 0.5))
    assert np.abs(whole).argmax() in range(1000, 1006)
    assert np.allclose(half, whole / 2)


def test_the_housing_answers_as_three_masses_on_springs():
    actuator = Actuator()
    impulse = np.zeros(FS)
    impulse[0] = 1.0
    response = np.fft.rfft(housing_acceleration(impulse, actuator, FS))
    hertz = np.fft.rfftfreq(FS, 1 / FS)[1:3000]
    s = 2j * np.pi * hertz
    expected = np.zeros_like(s)
    for mode, share in ((420, 0.3), (1900, 0.4), (5200, 0.3)):
        omega = 2 * np.pi * mode
        expected += share * s**2 / (s**2 + 2 * 0.04 * omega * s + omega**2)
    expected /= 12.0 * GRAVITY
    error = np.abs(response[1:3000] - expected).max()
    assert error < 0.02 * np.abs(expected).max()  # of the bilinear transform


def test_a_constant_force_does_not_shake_for_ever():
    shaking = housing_acceleration(np.ones(FS), Actuator(), FS)
    assert np.abs(shaking[FS // 2 :]).max() < 1e-9
