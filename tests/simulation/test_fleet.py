"""Fleets have the states, units and lives that they state."""

import numpy as np
import pytest
from scipy.stats import kstest, weibull_min

from emacm import OrderPSD, OrderResampler
from emacm.simulation import WearLaw, run_to_failure_fleet, simulate_fleet
from emacm.simulation.fleet import STATES, simulate_actuator


def test_the_same_seed_gives_the_same_recording_and_another_seed_unit_or_run_another():
    one, again = (simulate_actuator("screw", seed=5, duration=0.5) for _ in range(2))
    assert one == again
    for other in ({"seed": 6}, {"unit": 1, "seed": 5}, {"run": 2, "seed": 5}):
        assert one != simulate_actuator("screw", duration=0.5, **other)


def test_a_fleet_has_units_and_runs_of_every_state():
    recordings, states, units = simulate_fleet(2, 2, seed=1, severity=(0.4, 0.6))
    assert len(recordings) == len(states) == len(units) == 12
    assert {state: len(set(units[states == state])) for state in STATES} == dict.fromkeys(STATES, 2)
    assert len(set(units)) == 6
    assert [recording.meta["label"] for recording in recordings] == states.tolist()
    assert [recording.meta["unit"] for recording in recordings] == units.tolist()
    severities = [recording.meta["severity"] for recording in recordings]
    assert severities[:4] == [0] * 4
    assert all(0.4 <= severity <= 0.6 for severity in severities[4:])
    assert len(set(severities)) == 5


def spectrum(recording, channel):
    resampler = OrderResampler(2 * np.pi / 64, channels=[channel], min_speed=1.0)
    psd = OrderPSD(8, max_order=26)
    (power,) = psd.fit_transform(resampler.fit_transform([recording]))
    return psd.orders_, np.asarray(power)


def level(recording, channel, order):
    orders, power = spectrum(recording, channel)
    return power[np.abs(orders - order) <= 0.15].max()


def test_the_shaft_moves_back_and_forth_by_28_revolutions_at_most_61_per_second():
    recording = simulate_actuator()
    table = OrderResampler(min_speed=1.0).quality([recording])
    assert table["longest_stroke"][0] == pytest.approx(28, abs=0.3)
    assert table["strokes"][0] in (8, 9)  # of 1 / 1.4 s
    assert table["fastest"][0] == pytest.approx(2 * np.pi * 61.6, rel=0.01)
    lead = np.polyfit(recording.angle, recording.signals["lvdt"][::10], 1)[0]  # in/rad
    assert lead == pytest.approx(0.1575 / (2 * np.pi), rel=1e-3)


@pytest.mark.parametrize("state", STATES[1:])
def test_a_fault_is_at_its_order_in_the_vibration_and_beside_order_6_in_the_current(state):
    faulty, healthy = simulate_actuator(state), simulate_actuator()
    ((order,),) = faulty.meta["orders"].values()
    side = 1.0 if state == "inner ring" else 0.0  # it turns through the load zone
    for channel, line in (
        ("accelerometer", order),
        ("accelerometer", 2 * order + side),
        ("current_a", 6 + order + side),
        ("current_a", abs(6 - order) + side),
    ):
        assert level(faulty, channel, line) > 5 * level(healthy, channel, line)
    assert healthy.meta["orders"] == {}
    orders, power = spectrum(healthy, "current_a")
    assert orders[power.argmax()] == 6


def test_the_level_is_that_of_the_unit_in_all_its_runs():
    levels = [
        [np.log(np.std(simulate_actuator(unit=u, run=r).signals["accelerometer"])) for r in (1, 2)]
        for u in range(12)
    ]
    assert np.corrcoef(np.transpose(levels))[0, 1] > 0.8


@pytest.mark.parametrize(
    ("make", "arguments", "message"),
    [
        (simulate_actuator, {"state": "worn"}, "state must be one of 'healthy'"),
        (simulate_fleet, {"severity": (0.5, 1.5)}, "severity must be .* at most 1, got 1.5"),
        (simulate_fleet, {"severity": 0.5}, "severity must be a pair such as"),
        (simulate_fleet, {"n_runs": 0}, "n_runs must be a whole number of at least 1"),
        (run_to_failure_fleet, {"n_units": -1}, "n_units must be a whole number of at least 1"),
        (run_to_failure_fleet, {"interval": 0.0}, "interval must be a number of h, above 0"),
        (WearLaw, {"start": 1.0}, "start must be"),
    ],
)
def test_a_wrong_parameter_is_named(make, arguments, message):
    counts = {simulate_fleet: {"n_units": 1, "n_runs": 1}, run_to_failure_fleet: {"n_units": 1}}
    with pytest.raises((TypeError, ValueError), match=message):
        make(**counts.get(make, {}) | arguments)


# Units that wear out


def test_onset_and_growth_have_the_stated_law():
    law = WearLaw(onset_shape=1.5, onset_scale=90.0, drift=0.05, drift_spread=0.0, diffusion=0.01)
    lives = [law.draw(unit, 5.0) for unit in range(400)]
    onsets = [life.onset for life in lives]
    assert kstest(onsets, weibull_min(1.5, scale=90.0).cdf).pvalue > 0.01
    # First passage of a Wiener process with drift: mean distance / drift.
    durations = np.array([life.life - life.onset for life in lives])
    mean = -np.log(0.05) / 0.05
    error = np.sqrt(mean * 0.01 / 0.05**2 / 400)
    assert durations.mean() == pytest.approx(mean, abs=3 * error)


def test_without_scatter_the_severity_grows_exponentially():
    law = WearLaw(drift=0.02, drift_spread=0.0, diffusion=0.0, start=0.1)
    life = law.draw(7, 8.0)
    damaged = life.severity > 0
    expected = 0.1 * np.exp(0.02 * (life.ages[damaged] - life.onset))
    np.testing.assert_allclose(life.severity[damaged], expected, rtol=1e-9)
    assert life.life == pytest.approx(life.onset + np.log(10) / 0.02, abs=8.0 / 64)
    assert life.ages[-1] < life.life <= life.ages[-1] + 8.0


def test_the_same_unit_has_the_same_life_also_if_it_is_observed_for_less():
    law = WearLaw()
    whole, part = law.draw(11, 10.0), law.draw(11, 10.0, observed=55.0)
    assert (whole.life, whole.onset) == (part.life, part.onset)
    assert part.censored
    assert part.ages[-1] == 50.0
    np.testing.assert_array_equal(part.severity, whole.severity[:6])
    assert law.draw(12, 10.0).life != whole.life
    assert law.draw(11, 10.0, seed=1).life != whole.life


def test_recordings_state_the_true_life_and_the_severity_is_that_of_the_law():
    fleet = run_to_failure_fleet(2, interval=60.0, duration=0.3, first_unit=4)
    meta = [recording.meta for recording in fleet]
    assert [m["unit"] for m in meta] == sorted(m["unit"] for m in meta)
    for m in meta:
        life = WearLaw().draw(m["unit"], 60.0)
        assert m["severity"] == life.severity[round(m["age"] / 60)]
        assert m["remaining_life"] == life.life - m["age"]
        assert m["label"] == ("inner ring" if m["age"] >= life.onset else "healthy")
