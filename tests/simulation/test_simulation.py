"""The public face of simulation has everything a study needs."""

import inspect

import pytest

import emacm.simulation as simulation


def test_all_names_are_there_once():
    assert len(set(simulation.__all__)) == len(simulation.__all__)
    for name in simulation.__all__:
        assert hasattr(simulation, name)


@pytest.mark.parametrize(
    "name",
    [name for name in simulation.__all__ if inspect.isroutine(getattr(simulation, name))],
)
def test_every_function_is_documented(name):
    assert "Returns\n" in inspect.getdoc(getattr(simulation, name))


def test_the_names_of_the_demo_are_still_there():
    assert simulation.STATES == ("healthy", "screw", "bearing")
    assert simulation.SCREW_ORDER == 3.125
    # The demo's bearing is that of the thesis, whose geometry the bench assumes.
    (inner_ring,) = simulation.FAULT_ORDERS["inner ring"]
    assert inner_ring == pytest.approx(simulation.BEARING_ORDER, abs=5e-4)
    recordings, states, units = simulation.simulate_fleet(1, 1)
    assert len(recordings) == len(states) == len(units) == 3
