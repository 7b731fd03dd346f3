"""The actuator's constants, and units and runs drawn from them."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from emacm.simulation.actuator import PEAK_SPEED, Actuator, draw_run, draw_unit
from emacm.simulation.conditions import POUND


def drawn(seed, spread=1.0):
    return draw_unit(Actuator(), np.random.default_rng(seed), spread=spread)


def test_the_peak_speed_is_4572_rpm():
    assert PEAK_SPEED / (2 * np.pi) * 60 == pytest.approx(4572)


@pytest.mark.parametrize("lead", [0.1, 0.2, 0.5])
def test_15_6_ampere_hold_3700_pounds_at_any_lead(lead):
    # Table 4.1; the screw passes on 0.9 of the motor's work.
    actuator = Actuator(screw_lead=lead)
    torque = actuator.torque_constant * 15.6 * np.sqrt(2)
    assert 0.9 * torque / actuator.torque_per_force == pytest.approx(3700 * POUND)


def test_units_scatter_around_the_drawing():
    units = [asdict(drawn(seed)) for seed in range(400)]
    for name, expected in asdict(Actuator()).items():
        values = np.array([unit[name] for unit in units])
        if np.ptp(values):
            middle = np.median(values)
            error = 1.2533 * values.std() / np.sqrt(len(values))  # of a median
            assert abs(middle - expected) < 4.5 * error, name


def test_runs_of_a_unit_scatter_less_than_units():
    unit = drawn(0)
    runs = [draw_run(unit, np.random.default_rng(seed)) for seed in range(200)]
    units = [drawn(seed) for seed in range(200)]
    for name in ("coulomb", "rolling_noise", "electrical_noise"):
        of_runs, of_units = (
            np.std(np.log([getattr(one, name) for one in some])) for some in (runs, units)
        )
        assert 0 < of_runs < of_units / 3
    assert len({run.ripple for run in runs}) == 1


@pytest.mark.parametrize("spread", [0.5, 2.0])
def test_the_spread_scales_what_units_differ_by(spread):
    usual, other = drawn(5), drawn(5, spread)
    ratio = np.log(other.coulomb / 0.4) / np.log(usual.coulomb / 0.4)
    assert ratio == pytest.approx(spread)
    assert other.lvdt_offset == pytest.approx(spread * usual.lvdt_offset)


def test_without_spread_all_units_and_runs_are_the_drawing():
    assert drawn(3, 0.0) == drawn(4, 0) == Actuator()
    assert draw_run(drawn(3), np.random.default_rng(0), spread=0) == drawn(3)


def test_a_drawing_of_ones_own_is_kept_where_units_do_not_differ():
    nominal = Actuator(screw_lead=0.25, inertia=3e-3)
    unit = draw_unit(nominal, np.random.default_rng(0))
    assert (unit.screw_lead, unit.inertia) == (0.25, 3e-3)


@pytest.mark.parametrize(
    ("constants", "error", "message"),
    [
        ({"screw_lead": 0}, ValueError, "screw_lead must be a number above 0, got 0"),
        ({"efficiency": 1.2}, ValueError, "efficiency must be a number above 0 and at most 1"),
        ({"inertia": -1}, ValueError, "inertia must be a number above 0, got -1"),
        ({"coulomb": -0.1}, ValueError, "coulomb must be a number at least 0, got -0.1"),
        ({"mark": "a"}, TypeError, "mark must be a number, got 'a'"),
    ],
)
def test_an_impossible_constant_is_named(constants, error, message):
    with pytest.raises(error, match=message):
        Actuator(**constants)
    with pytest.raises(error, match=message):
        replace(Actuator(), **constants)


def test_a_negative_spread_is_refused():
    with pytest.raises(ValueError, match="unit_spread must be a number at least 0, got -1"):
        drawn(0, -1)
    with pytest.raises(ValueError, match="run_spread must be a number at least 0, got -1"):
        draw_run(Actuator(), np.random.default_rng(0), spread=-1)
