"""Lines between the orders of a shaft: those of a machine that repeats its motion."""

import numpy as np
import pytest

from emacm.shaft.vibration import orders_stand_out

FS = 2000
TIMES = np.arange(4 * FS) / FS
ORDERS = np.arange(1.0, 25)
SPEED = 14.0


def repeated(seed, *, in_noise=0.5):
    """A motion of 1 s that stops once, repeated: lines 1 Hz apart, four bins of a spectrum."""
    rng = np.random.default_rng(seed)
    once = rng.normal(size=FS) * np.abs(np.sin(np.pi * TIMES[:FS]))
    return np.tile(once, 4) + in_noise * rng.normal(size=len(TIMES))


def shaft(seed, n_orders=12):
    rng = np.random.default_rng(seed)
    turns = 2 * np.pi * SPEED * TIMES
    tones = sum(np.cos(k * turns + rng.uniform(0, 6)) for k in range(1, n_orders + 1))
    return tones + rng.normal(size=len(TIMES))


def bearing(seed):
    """Harmonics of order 3.5833 = 43/12: at all twelfths of the distance of two orders."""
    rng = np.random.default_rng(seed)
    turns = 2 * np.pi * SPEED * TIMES
    return sum(np.cos(43 / 12 * k * turns + rng.uniform(0, 6)) for k in range(1, 7))


def stands_out(signal):
    return orders_stand_out(signal, SPEED, 0.0, ORDERS, FS, FS / 2)


@pytest.mark.parametrize("seed", range(6))
def test_the_lines_of_a_shaft_stand_out(seed):
    assert stands_out(shaft(seed))


@pytest.mark.parametrize("seed", range(6))
def test_close_lines_of_a_repeated_motion_are_not_the_orders_of_a_shaft(seed):
    # Any 14 of these lines look like one order; seven of them are too near to others to be counted.
    assert not stands_out(repeated(seed))
    assert not stands_out(repeated(seed, in_noise=1.0))


@pytest.mark.parametrize("seed", range(6))
def test_steady_lines_of_a_bearing_between_the_orders_do_not_hide_the_shaft(seed):
    assert stands_out(shaft(seed) + bearing(seed))


@pytest.mark.parametrize("seed", range(6))
def test_a_shaft_of_varying_level_without_lines_between_its_orders_stands_out(seed):
    assert stands_out(shaft(seed) * (1 + 0.4 * np.sin(2 * np.pi * 0.7 * TIMES)))
