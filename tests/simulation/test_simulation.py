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


def test_orders_of_the_screw_and_of_the_inner_ring_are_those_of_their_geometry():
    # 10 (1 - 0.1323 cos 45 degrees) and, as in the thesis, 6.123.
    assert simulation.FAULT_ORDERS["screw"] == pytest.approx((9.064498,), abs=1e-6)
    assert simulation.FAULT_ORDERS["inner ring"] == pytest.approx((6.122915,), abs=1e-6)
    assert dict(simulation.CHAPTER3_ORDERS) == {
        "healthy": None,
        "defect 1": 3.125,
        "defect 2": 10.5,
    }
