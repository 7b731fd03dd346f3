"""Faults have the orders that their geometry gives, and strike when balls pass."""

import numpy as np
import pytest

from emacm.simulation.faults import (
    CAGE_ORDER,
    FAULT_ORDERS,
    FAULTS,
    ball_passage,
    check_faults,
)

TURN = 2 * np.pi
ROLLING = [name for name, fault in FAULTS.items() if fault.rolls]


def passage(fault, revolutions=200, seed=0, mark=0.0):
    angle = np.linspace(0, TURN * revolutions, 500 * revolutions)
    return angle, ball_passage(FAULTS[fault], angle, np.random.default_rng(seed), mark)


def test_orders_of_rolling_faults_are_those_of_textbook_geometry():
    # Randall and Antoni, Rolling element bearing diagnostics, Eqs. (1) to (4), written out.
    gamma = 0.2478 * np.cos(np.radians(25))
    expected = {
        "inner ring": 5 * (1 + gamma),
        "outer ring": 5 * (1 - gamma),
        "ball": (1 - gamma**2) / 0.2478,  # it meets either ring once in a turn of its own
        "cage": (1 - gamma) / 2,
        "screw": 10 * (1 - 0.1323 * np.cos(np.radians(45))),
    }
    assert round(expected["inner ring"], 3) == 6.123  # chapter 4
    for fault, order in expected.items():
        assert FAULT_ORDERS[fault] == pytest.approx((order,), rel=1e-13)


@pytest.mark.parametrize("fault", ROLLING)
def test_strikes_come_at_the_order_of_the_fault(fault):
    _, passed = passage(fault)
    (order,) = FAULT_ORDERS[fault]
    # The way scatters by 0.5 % a strike, independently.
    allowed = 1 + 4 * 0.005 * np.sqrt(200 * order)
    assert abs(len(passed.impacts) - 200 * order) < allowed


def test_the_way_between_strikes_scatters_by_half_a_per_cent_and_independently():
    angle, passed = passage("outer ring", 2000)
    ways = np.diff(angle[passed.impacts])
    rounding = (angle[1] / np.sqrt(6) / ways.mean()) ** 2
    share = np.sqrt(ways.var() / ways.mean() ** 2 - rounding)
    assert share == pytest.approx(0.005, rel=0.1)


def test_a_defect_of_the_inner_ring_passes_the_load_zone_once_a_revolution():
    angle, passed = passage("inner ring", mark=1.0)
    heaviest = angle[passed.weight > 1 - 1e-6]
    assert np.angle(np.exp(1j * (heaviest + 1.0))) == pytest.approx(0, abs=0.01)
    assert passed.weight.max() == pytest.approx(1, abs=1e-4)
    assert 0 < passed.weight.min() < 0.1


def test_a_ball_is_loaded_at_the_order_of_the_cage():
    angle, passed = passage("ball")
    spectrum = np.abs(np.fft.rfft(passed.weight - passed.weight.mean()))
    order = spectrum.argmax() / (angle[-1] / TURN)
    assert order == pytest.approx(CAGE_ORDER, abs=1 / 200)


@pytest.mark.parametrize(
    ("faults", "error", "message"),
    [
        ({"rust": 0.5}, ValueError, "a fault must be one of 'inner ring', .*; got 'rust'"),
        ({"ball": 1.1}, ValueError, "severity of 'ball' .* got 1.1"),
        ({"ball": "bad"}, TypeError, "severity of 'ball' .* got 'bad'"),
        (["ball"], TypeError, r"faults must be .*, got \['ball'\]"),
    ],
)
def test_a_fault_that_is_none_is_refused(faults, error, message):
    with pytest.raises(error, match=message):
        check_faults(faults)
