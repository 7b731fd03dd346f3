"""Rolling elements pass a defect at its order, with slip, and under the load of their place."""

import numpy as np
import pytest

from emacm.simulation.impacts import ball_passage

TURN = 2 * np.pi


def passage(order=6.123, revolutions=200, **options):
    angle = np.linspace(0, TURN * revolutions, 500 * revolutions)
    return angle, ball_passage(order, angle, np.random.default_rng(0), **options)


@pytest.mark.parametrize("order", [0.39, 6.123, 9.06])
def test_impacts_occur_at_the_order_of_the_defect(order):
    _, passed = passage(order)
    # The distance between two scatters by 0.5 %, independently.
    allowed = 1 + 4 * 0.005 * np.sqrt(200 * order)
    assert abs(len(passed.impacts) - 200 * order) < allowed
    assert np.flatnonzero(passed.force).tolist() == passed.impacts.tolist()


def test_the_distance_between_impacts_scatters_by_half_a_per_cent_and_independently():
    angle, passed = passage(revolutions=2000)
    distances = np.diff(angle[passed.impacts])
    rounding = (angle[1] / np.sqrt(6) / distances.mean()) ** 2
    scatter = np.sqrt(distances.var() / distances.mean() ** 2 - rounding)
    assert scatter == pytest.approx(0.005, rel=0.1)


def test_a_defect_that_turns_with_the_shaft_passes_the_load_zone_once_a_revolution():
    angle, passed = passage(turns_with=1.0, mark=1.0)
    heaviest = angle[passed.weight > 1 - 1e-6]
    assert np.angle(np.exp(1j * (heaviest + 1.0))) == pytest.approx(0, abs=0.01)
    assert passed.weight.max() == pytest.approx(1, abs=1e-4)
    assert 0 < passed.weight.min() < 0.1
