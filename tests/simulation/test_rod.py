"""The rod follows the screw, gives way to its load, and has lash where the load changes sides."""

import numpy as np
import pytest

from emacm.simulation.actuator import Actuator
from emacm.simulation.conditions import POUND
from emacm.simulation.rod import rod_position

FS = 48_000
TIMES = np.arange(FS) / FS
STILL = np.full(FS, 10.0)


def test_without_load_a_revolution_is_a_lead():
    angle = 2 * np.pi * TIMES
    position, _ = rod_position(angle, np.zeros(FS), Actuator(screw_lead=0.25), 0.0, FS)
    assert np.allclose(position, 0.25 * TIMES)


def test_the_rod_gives_way_by_force_over_stiffness():
    actuator = Actuator(stiffness=5e7)
    free, pressed = (
        rod_position(STILL, np.full(FS, force), actuator, 0.0, FS)[0] for force in (0.0, 1000.0)
    )
    assert np.allclose((free - pressed) * 0.0254, 1000 * POUND / 5e7)


@pytest.mark.parametrize("severity", [0.25, 1.0])
def test_the_lash_is_crossed_when_the_load_changes_its_sign(severity):
    force = 500 * np.cos(2 * np.pi * 5 * TIMES)
    tight, _ = rod_position(STILL, force, Actuator(), 0.0, FS)
    loose, knocks = rod_position(STILL, force, Actuator(), severity, FS)
    assert len(knocks) == 10
    assert np.ptp(loose - tight) == pytest.approx(0.01 * severity, rel=1e-6)
    crossing = np.flatnonzero(np.diff(np.sign(force)))
    # Friction of 10 lbf holds the nut a little longer.
    assert np.all((knocks - crossing >= 0) & (knocks - crossing < 0.001 * FS))


def test_under_a_load_of_one_sign_lash_does_not_show():
    position, knocks = rod_position(STILL, np.full(FS, 116.0), Actuator(), 1.0, FS)
    assert not len(knocks)
    assert np.ptp(position) < 1e-12


def test_noise_of_the_load_around_zero_does_not_knock():
    wander = 2 * np.sin(2 * np.pi * 50 * TIMES)
    _, knocks = rod_position(STILL, wander, Actuator(), 1.0, FS)
    assert not len(knocks)
