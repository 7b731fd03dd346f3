"""Simulated actuators have the faults that their labels state."""

import numpy as np
import pytest

from emacm import OrderPSD, OrderResampler
from emacm.simulation.fleet import STATES, simulate_actuator, simulate_fleet, thesis_benches


def density_at(recording, channel, order):
    """Density at an order over the median of its neighbourhood."""
    psd = OrderPSD(8, max_order=30)
    resampler = OrderResampler(2 * np.pi / 64, channels=[channel], min_speed=1.0)
    table = psd.fit_transform(resampler.fit_transform([recording]))
    near = np.abs(psd.orders_ - order) <= 0.15
    around = (np.abs(psd.orders_ - order) < 1) & (np.abs(psd.orders_ - order) > 0.4)
    return table[0, near].max() / np.median(table[0, around])


@pytest.mark.parametrize(("state", "order"), [("screw", 9.0645), ("inner ring", 4 * 6.1229)])
def test_a_fault_stands_at_its_order_and_only_in_its_state(state, order):
    sick = simulate_actuator(state, severity=1, seed=3)
    raised = density_at(sick, "accelerometer", order)
    assert raised > 15
    for other in set(STATES) - {state}:  # the passage of balls has a small line without a fault
        assert raised > 2.5 * density_at(simulate_actuator(other, seed=3), "accelerometer", order)


def test_the_shaft_reverses_and_its_speed_varies_strongly():
    velocity = simulate_actuator(seed=0).signals["velocity"]
    assert velocity.min() < -2 * np.pi * 40
    assert velocity.max() > 2 * np.pi * 40


def test_the_same_seed_gives_the_same_recording_and_another_seed_another():
    one, again = (simulate_actuator("screw", seed=5, duration=0.5) for _ in range(2))
    assert one == again
    assert one != simulate_actuator("screw", seed=6, duration=0.5)


def test_severity_nought_is_healthy():
    assert simulate_actuator("screw", severity=0, duration=0.5) == simulate_actuator(duration=0.5)


def test_the_rate_is_that_of_the_option_and_its_noise_is_filtered():
    assert set(simulate_actuator(fs=3200, duration=0.5).fs.values()) == {3200}


def test_a_fleet_has_units_and_runs_of_every_state():
    recordings, states, units = simulate_fleet(2, 3, seed=1, severity=(0.4, 0.6))
    assert len(recordings) == len(states) == len(units) == 18
    assert {state: len(set(units[states == state])) for state in STATES} == dict.fromkeys(STATES, 2)
    assert len(set(units)) == 6
    assert [recording.meta["label"] for recording in recordings] == states.tolist()
    assert [recording.meta["unit"] for recording in recordings] == units.tolist()
    severities = [recording.meta["severity"] for recording in recordings]
    assert severities[:6] == [0] * 6
    assert all(0.4 <= severity <= 0.6 for severity in severities[6:])
    assert len(set(severities)) == 5


def test_units_of_other_numbers_are_other_units():
    first, *_ = simulate_fleet(2, 1, seed=1)
    later, *_ = simulate_fleet(1, 1, seed=1, first_unit=1)
    assert first[1] == later[0]
    assert first[0] != later[0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"state": "worn"}, "state must be one of 'healthy', 'screw', 'inner ring'"),
        ({"state": "screw", "severity": -1}, "severity of 'screw' must be a number at least 0"),
        ({"state": "screw", "fs": 0}, "fs must be a number of Hz, above 0, got 0"),
        ({"fs": 3, "duration": 0.5}, "fs must be a number of Hz, above 4, got 3"),
    ],
)
def test_a_wrong_parameter_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        simulate_actuator(**arguments)


def test_the_range_of_severities_is_a_pair_in_0_to_1():
    with pytest.raises(ValueError, match="severity must be a number at least 0 and at most 1"):
        simulate_fleet(1, 1, severity=(0.5, 1.5))
    with pytest.raises(TypeError, match=r"severity must be a pair such as \(0.3, 0.7\), got 0.5"):
        simulate_fleet(1, 1, severity=0.5)


def test_the_degraded_unit_has_a_bad_inner_ring_and_three_quarters_of_its_grease():
    healthy, degraded = thesis_benches()
    assert healthy.faults == {}
    assert degraded.faults == {"inner ring": 0.5, "lubrication": 0.25}
    assert degraded.orders["inner ring"][0] == pytest.approx(6.123, abs=5e-4)
    assert degraded.electrical_noise < healthy.electrical_noise


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"grease": 1.2}, ValueError, "grease must be a number at least 0 and at most 1, got 1.2"),
        ({"severity": 2}, ValueError, "severity of 'inner ring' must be a number"),
        ({"electrical_noise": 1.0}, TypeError, "electrical_noise must be a pair, .* got 1.0"),
    ],
)
def test_a_wrong_unit_of_the_thesis_is_named(arguments, error, message):
    with pytest.raises(error, match=message):
        thesis_benches(**arguments)
