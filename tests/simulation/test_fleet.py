"""Simulated actuators have the faults that they say."""

import numpy as np
import pytest

from emacm import OrderPSD, OrderResampler
from emacm.simulation.fleet import (
    BEARING_ORDER,
    SCREW_ORDER,
    STATES,
    simulate_actuator,
    simulate_fleet,
)


def density_at(recording, channel, order):
    """Density at an order over the median of its neighbourhood."""
    psd = OrderPSD(8, max_order=24)
    table = psd.fit_transform(
        OrderResampler(2 * np.pi / 64, channels=[channel]).fit_transform([recording])
    )
    near = np.abs(psd.orders_ - order) <= 0.15
    around = (np.abs(psd.orders_ - order) < 1) & (np.abs(psd.orders_ - order) > 0.4)
    return table[0, near].max() / np.median(table[0, around])


@pytest.mark.parametrize(
    ("state", "channel", "order"),
    [
        ("screw", "current", SCREW_ORDER),
        ("bearing", "vibration", BEARING_ORDER),
        ("bearing", "vibration", 2 * BEARING_ORDER),
    ],
)
def test_a_fault_stands_at_its_order_and_only_in_its_state(state, channel, order):
    assert density_at(simulate_actuator(state, severity=2, seed=3), channel, order) > 4
    for other in set(STATES) - {state}:
        assert density_at(simulate_actuator(other, severity=2, seed=3), channel, order) < 2.5


def test_the_shaft_reverses_and_its_speed_varies_strongly():
    velocity = simulate_actuator("healthy", seed=0).velocity
    assert velocity.min() < -2 * np.pi * 10
    assert velocity.max() > 2 * np.pi * 10


def test_the_same_seed_gives_the_same_recording_and_another_seed_another():
    assert simulate_actuator("screw", seed=5) == simulate_actuator("screw", seed=5)
    assert simulate_actuator("screw", seed=5) != simulate_actuator("screw", seed=6)


def test_severity_nought_is_healthy_but_for_its_name():
    sound = simulate_actuator("healthy", severity=3, seed=2)
    nought = simulate_actuator("screw", severity=0, seed=2)
    assert sound.meta["severity"] == nought.meta["severity"] == 0
    assert np.array_equal(sound.signals["current"], nought.signals["current"])


def test_a_fleet_has_units_and_runs_of_every_state():
    recordings, states, units = simulate_fleet(2, 3, seed=1)
    assert len(recordings) == len(states) == len(units) == 18
    assert sorted(set(units)) == [f"{s} {i}" for s in sorted(STATES) for i in range(2)]
    assert all(r.meta["unit"] == unit for r, unit in zip(recordings, units, strict=True))


def test_units_of_other_numbers_are_other_units():
    first, *_ = simulate_fleet(2, 1, seed=1)
    later, *_ = simulate_fleet(1, 1, seed=1, first_unit=1)
    assert first[1] == later[0]
    assert first[0] != later[0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"state": "worn"}, "state must be one of 'healthy', 'screw', 'bearing'"),
        ({"state": "screw", "severity": -1}, "severity must be a number at least 0, got -1"),
        ({"state": "screw", "fs": 0}, "fs must be a number of Hz, above 0, got 0"),
    ],
)
def test_a_wrong_parameter_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        simulate_actuator(**arguments)
