"""The actuator follows its command as far as speed and torque allow."""

import numpy as np
import pytest

from emacm.simulation.actuator import PEAK_SPEED, Actuator
from emacm.simulation.conditions import CONDITIONS, POUND, Condition, position_command
from emacm.simulation.mechanics import bench_motion, jam_torque, rod_position

FS = 9600
TIMES = np.arange(5 * FS) / FS
REST = Condition("sine", 1.0, 0.0, 1.0, 0.0, 0.0)


def moved(number, actuator=None, **more):
    condition = CONDITIONS[number] if isinstance(number, int) else number
    return bench_motion(condition, actuator or Actuator(), TIMES, **more)


def inches(motion, actuator=None):
    return motion.angle / (actuator or Actuator()).angle_per_inch


@pytest.mark.parametrize("number", CONDITIONS)
@pytest.mark.parametrize("lead", [0.1, 0.2, 0.5])
def test_the_shaft_never_turns_faster_than_4572_rpm(number, lead):
    motion = moved(number, Actuator(screw_lead=lead))
    assert np.abs(motion.velocity).max() <= PEAK_SPEED


@pytest.mark.parametrize("number", CONDITIONS)
def test_the_angle_is_the_integral_of_the_speed_and_that_of_the_acceleration(number):
    motion = moved(number)
    for above, below in (
        (motion.angle, motion.velocity),
        (motion.velocity, motion.acceleration),
    ):
        integral = np.cumsum((below[1:] + below[:-1]) / 2) / FS
        # Kinks of the acceleration lie between samples.
        assert np.abs(above[1:] - above[0] - integral).max() < 1e-3 * np.ptp(above)


@pytest.mark.parametrize("number", [1, 4])
def test_a_sine_is_followed_like_a_lag_of_first_order(number):
    # Position gain 40/s, and a velocity loop ten times as fast.
    row = CONDITIONS[number]
    s = 2j * np.pi * row.frequency
    gain = 1 / (1 + s / 40 * (1 + s / (2 * np.pi * 60)))
    wave = row.amplitude * (gain * np.exp(s * TIMES)).imag
    away = inches(moved(number)) - row.bias - wave
    assert np.abs(away).max() < 0.002 * abs(row.amplitude)


def test_a_triangle_is_followed_at_its_speed():
    motion = moved(5)
    speed = np.abs(motion.velocity)
    asked = 4 * 1.55 * 0.41 * Actuator().angle_per_inch
    assert np.median(speed) == pytest.approx(asked, rel=1e-3)


def test_a_command_above_the_peak_speed_is_cut_short():
    # 17.5 in/s are 6685 RPM at a lead of 0.1575 in, and 4211 at 0.25 in.
    reach = PEAK_SPEED / (2 * np.pi) * 0.1575 / (2 * 2.14)  # in, within half a period
    coarse = Actuator(screw_lead=0.25, torque_gain=0.5)
    assert np.ptp(inches(moved(3))) < reach < np.ptp(inches(moved(3, coarse), coarse)) < 2 * 2.05


def test_the_voltage_limits_the_speed_of_a_coarse_screw():
    # A lead of 0.25 in needs a torque constant whose EMF is 328 V at 4572 RPM.
    coarse = Actuator(screw_lead=0.25)
    fastest = np.abs(moved(3, coarse).velocity).max()
    free = 0.95 * 220 * np.sqrt(2 / 3) / coarse.emf_constant  # without current
    assert 0.9 * free < fastest < 1.01 * free < 0.7 * PEAK_SPEED


def test_a_finer_screw_turns_more():
    coarse, fine = (moved(1, Actuator(screw_lead=lead)) for lead in (0.2, 0.1))
    assert np.ptp(fine.angle) == pytest.approx(2 * np.ptp(coarse.angle), rel=1e-6)


def test_condition_1_turns_about_one_revolution_per_stroke():
    assert np.ptp(moved(1).angle) / (2 * np.pi) == pytest.approx(0.2 / 0.1575, abs=0.01)


@pytest.mark.parametrize("current", [2.5, 25.0])
def test_without_load_and_friction_the_torque_sets_the_steepest_change_of_speed(current):
    actuator = Actuator(max_current=current, coulomb=0.0, viscous=0.0, efficiency=1.0)
    free = Condition("triangle", 0.0, 2.0, 1.0, 0.0, 0.0)
    steps = np.arange(10_000) / 2000  # of the controller
    velocity = bench_motion(free, actuator, steps).velocity
    steepest = np.abs(np.diff(velocity)).max() * 2000
    assert steepest == pytest.approx(actuator.max_torque / actuator.inertia, rel=1e-6)


def test_an_actuator_without_command_stays_where_it_is():
    motion = moved(REST)
    assert np.ptp(motion.angle) < 1e-9
    assert np.all(motion.velocity == 0)


def test_the_phase_of_the_command_shifts_the_motion_in_time():
    row = CONDITIONS[4]
    shift = FS // 2
    phase = 2 * np.pi * row.frequency * shift / FS
    early, late = moved(4), moved(4, phase=phase)
    # The controller's steps fall otherwise between samples.
    assert np.abs(early.angle[shift:] - late.angle[:-shift]).max() < 0.05
    assert late.angle[0] != pytest.approx(early.angle[0], abs=1)
    assert position_command(row, np.zeros(1), phase)[0] != row.bias


def test_a_total_jam_under_load_stops_the_actuator_and_a_slight_one_does_not():
    assert np.ptp(moved(4, jam=1.0).angle) < 0.9 * np.ptp(moved(4).angle)
    assert np.ptp(moved(4, jam=0.1).angle) == pytest.approx(np.ptp(moved(4).angle), rel=1e-6)


def test_a_jam_brakes_at_one_place_and_in_proportion_to_its_severity():
    actuator = Actuator()
    places = np.linspace(-3, 3, 601)
    half, whole = (jam_torque(places * actuator.angle_per_inch, actuator, s) for s in (0.5, 1.0))
    assert places[whole.argmax()] == pytest.approx(1.9)
    assert whole == pytest.approx(2 * half)
    assert whole[places < 1].max() < 1e-9
    assert not jam_torque(places, actuator, 0.0).any()


# The rod

ROD_FS = 48_000
ROD_TIMES = np.arange(ROD_FS) / ROD_FS
STANDSTILL = np.full(ROD_FS, 10.0)


def test_without_load_a_revolution_is_a_lead():
    angle = 2 * np.pi * ROD_TIMES
    position, _ = rod_position(angle, np.zeros(ROD_FS), Actuator(screw_lead=0.25), 0.0, ROD_FS)
    assert np.allclose(position, 0.25 * ROD_TIMES)


def test_the_rod_gives_way_by_force_over_stiffness():
    actuator = Actuator(stiffness=5e7)
    free, pressed = (
        rod_position(STANDSTILL, np.full(ROD_FS, force), actuator, 0.0, ROD_FS)[0]
        for force in (0.0, 1000.0)
    )
    assert np.allclose((free - pressed) * 0.0254, 1000 * POUND / 5e7)


@pytest.mark.parametrize("severity", [0.25, 1.0])
def test_the_lash_is_crossed_when_the_load_changes_its_sign(severity):
    force = 500 * np.cos(2 * np.pi * 5 * ROD_TIMES)
    tight, _ = rod_position(STANDSTILL, force, Actuator(), 0.0, ROD_FS)
    loose, knocks = rod_position(STANDSTILL, force, Actuator(), severity, ROD_FS)
    assert len(knocks) == 10
    assert np.ptp(loose - tight) == pytest.approx(0.01 * severity, rel=1e-6)
    crossing = np.flatnonzero(np.diff(np.sign(force)))
    # Friction of 10 lbf holds the nut a little longer.
    assert np.all((knocks - crossing >= 0) & (knocks - crossing < 0.001 * ROD_FS))


def test_under_a_load_of_one_sign_lash_does_not_show():
    position, knocks = rod_position(STANDSTILL, np.full(ROD_FS, 116.0), Actuator(), 1.0, ROD_FS)
    assert not len(knocks)
    assert np.ptp(position) < 1e-12


def test_noise_of_the_load_around_zero_does_not_knock():
    wander = 2 * np.sin(2 * np.pi * 50 * ROD_TIMES)
    _, knocks = rod_position(STANDSTILL, wander, Actuator(), 1.0, ROD_FS)
    assert not len(knocks)
