"""Torques balance, energy is kept, and the currents carry the torque."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from emacm import angle_from_currents
from emacm.simulation.actuator import Actuator
from emacm.simulation.bench import LaboratoryBench
from emacm.simulation.conditions import CONDITIONS, POUND, load_force
from emacm.simulation.faults import FAULTS, POLE_PAIRS, ball_passage
from emacm.simulation.mechanics import Motion, bench_motion
from emacm.simulation.motor import phase_currents, shaft_torques

FS = 48_000
TIMES = np.arange(2 * FS) / FS
ALL = {"inner ring": 0.5, "cage": 1.0, "eccentricity": 1.0, "lubrication": 1.0, "jam": 0.1}


def run(number=4, faults=None, actuator=None, times=TIMES):
    actuator, faults = actuator or Actuator(), faults or {}
    motion = bench_motion(CONDITIONS[number], actuator, times, jam=faults.get("jam", 0.0))
    force = load_force(CONDITIONS[number], motion.angle / actuator.angle_per_inch)
    rng = np.random.default_rng(0)
    passages = {n: ball_passage(n, motion.angle, rng) for n in faults if n == "inner ring"}
    return motion, force, shaft_torques(motion, force, actuator, faults, passages, rng)


def steady(speed, seconds=2):
    times = np.arange(seconds * FS) / FS
    constant = np.full_like(times, speed)
    return Motion(times, speed * times, constant, np.zeros_like(times))


def spun(speed, faults, force=0.0, **constants):
    """Torques at constant speed, without anything but the fault."""
    bare = {"ripple": 0.0, "cogging": 0.0, "coulomb": 0.0, "viscous": 0.0} | constants
    motion = steady(speed)
    actuator = Actuator(**bare)
    loads = np.full_like(motion.times, force)
    rng = np.random.default_rng(0)
    return actuator, shaft_torques(motion, loads, actuator, faults, {}, rng)


def line(signal, order, turns):
    """Amplitude at an order of a signal over a whole number of turns."""
    return 2 * np.abs(np.mean(signal * np.exp(-1j * order * turns)))


@pytest.mark.parametrize("number", CONDITIONS)
@pytest.mark.parametrize("faults", [{}, ALL])
def test_torques_balance_at_every_instant(number, faults):
    _, _, torques = run(number, faults)
    net = torques.motor - torques.load - torques.friction + torques.ripple
    assert np.abs(1.5e-3 * torques.acceleration - net).max() < 1e-9


@pytest.mark.parametrize("number", [3, 4, 5])
@pytest.mark.parametrize("faults", [{}, ALL])
def test_what_the_motor_spends_is_moved_lifted_or_lost(number, faults):
    _, _, torques = run(number, faults)
    spent, lifted, lost, won = (
        trapezoid(torque * torques.velocity, dx=1 / FS)
        for torque in (torques.motor, torques.load, torques.friction, torques.ripple)
    )
    kinetic = 1.5e-3 / 2 * (torques.velocity[-1] ** 2 - torques.velocity[0] ** 2)
    throughput = trapezoid(np.abs(torques.motor * torques.velocity), dx=1 / FS)
    assert spent == pytest.approx(kinetic + lifted + lost - won, abs=1e-4 * throughput)


def test_the_load_takes_its_force_times_the_travel():
    _, force, torques = run(5)
    work = trapezoid(torques.load * torques.velocity, dx=1 / FS)
    metres = torques.angle / (2 * np.pi) * 0.1575 * 0.0254
    travelled = trapezoid(force * POUND, metres)
    assert work == pytest.approx(travelled, rel=1e-3)


@pytest.mark.parametrize("number", CONDITIONS)
def test_friction_only_takes(number):
    motion, _, torques = run(number, {"lubrication": 1.0, "jam": 0.1})
    assert (torques.friction * motion.velocity).min() >= 0


def test_a_load_that_drives_costs_less_torque_than_one_that_is_driven():
    _, with_it = spun(100.0, {}, force=-1000.0)
    _, against_it = spun(100.0, {}, force=1000.0)
    torque = 1000 * POUND * Actuator().torque_per_force
    assert against_it.motor.mean() == pytest.approx(torque / 0.9)
    assert with_it.motor.mean() == pytest.approx(-torque * (2 - 1 / 0.9))


@pytest.mark.parametrize("speed", [2 * np.pi * 5, 2 * np.pi * 60, 2 * np.pi * 70])
def test_ripple_moves_the_shaft_as_the_velocity_loop_lets_it(speed):
    actuator, torques = spun(speed, {}, ripple=0.2)
    corner = 2 * np.pi * 60
    s = 1j * speed  # order 1
    response = s / (s**2 + 2 * 0.8 * corner * s + corner**2) / actuator.inertia
    late = slice(FS, None)  # the second second: whole turns, transient gone
    turns = speed * TIMES[late]
    assert line(torques.velocity[late], 1, turns) == pytest.approx(0.2 * abs(response), rel=1e-3)
    answered = abs(actuator.inertia * s * response - 1)
    assert line(torques.motor[late], 1, turns) == pytest.approx(0.2 * answered, rel=1e-3)


def test_slow_ripple_shows_in_the_torque_and_fast_ripple_does_not():
    _, slow = spun(2 * np.pi * 1, {"eccentricity": 1.0})
    _, fast = spun(2 * np.pi * 50, {}, cogging=0.3)
    late = slice(FS, None)
    turns = 2 * np.pi * TIMES[late]
    assert line(slow.motor[late], 1, turns) == pytest.approx(0.3, rel=0.05)
    assert line(fast.motor[late], 36, 50 * turns) < 0.1 * 0.3  # at 1800 Hz


@pytest.mark.parametrize(
    ("faults", "order"),
    [({"eccentricity": 1.0}, 1.0), ({"phase imbalance": 1.0}, 12.0), ({"cage": 1.0}, 0.3877)],
)
def test_a_fault_ripples_at_its_order_and_in_proportion_to_its_severity(faults, order):
    speed = 2 * np.pi * 20
    (name,) = faults
    lines = []
    for severity in (0.0, 0.5, 1.0):
        _, torques = spun(speed, {name: severity}, force=1000.0)
        lines.append(line(torques.ripple, order, speed * TIMES))
    none, half, whole = lines
    assert none < 1e-3 * whole
    assert half == pytest.approx(whole / 2, rel=0.01)


def test_dry_bearings_brake_more_and_unsteadily():
    quiet, dry = (spun(2 * np.pi * 20, {"lubrication": s}, coulomb=0.4)[1] for s in (0.0, 1.0))
    assert dry.friction.mean() == pytest.approx(2.5 * quiet.friction.mean())
    assert dry.ripple.std() > 0.1
    assert quiet.ripple.std() == 0


@pytest.mark.parametrize("fault", [None, *FAULTS])
def test_the_three_currents_sum_to_zero_under_every_fault(fault):
    # Three wires: what flows in by one phase flows out by the others, in an unequal motor too.
    bench = LaboratoryBench(unit=3, faults=fault, duration=0.5)
    currents = bench.truth(4).currents
    assert np.abs(currents).max() > 5
    assert np.abs(currents.sum(axis=0)).max() < 1e-12 * np.abs(currents).max()


def test_the_park_transform_gives_the_torque_back():
    _, _, torques = run()
    actuator = Actuator()
    a, b, c = phase_currents(torques.motor, torques.angle, actuator, {})
    electrical = POLE_PAIRS * torques.angle
    third = 2 * np.pi / 3
    along, across = (
        2 / 3 * (a * f(electrical) + b * f(electrical - third) + c * f(electrical + third))
        for f in (np.cos, np.sin)
    )
    length = torques.motor / actuator.torque_constant
    # The 5th and 7th harmonic pulsate at 6 times the electrical order.
    assert np.abs(along).max() < 0.02 * np.abs(length).max()
    assert np.abs(across + length).max() < 0.02 * np.abs(length).max()


def test_the_shaft_angle_can_be_read_from_the_currents():
    actuator, torques = spun(100.0, {}, force=1000.0, ripple=0.05)
    currents = phase_currents(torques.motor, torques.angle, actuator, {})
    angle = angle_from_currents(currents, pole_pairs=POLE_PAIRS)
    assert np.ptp(angle - torques.angle) < 0.01


@pytest.mark.parametrize("order", [6, 30, 42])
def test_a_current_has_its_fundamental_and_the_harmonics_of_dead_time(order):
    turns = 2 * np.pi * np.arange(10_000) / 1000
    actuator = Actuator()
    torque = np.full_like(turns, 10 * actuator.torque_constant)
    current = phase_currents(torque, turns, actuator, {})[0]
    assert line(current, order, turns) == pytest.approx({6: 10, 30: 0.1, 42: 0.07}[order])


def test_a_phase_that_lacks_current_is_phase_a():
    turns = 2 * np.pi * np.arange(10_000) / 1000
    torque = np.full_like(turns, 5.0)
    sound, lame = (
        np.abs(phase_currents(torque, turns, Actuator(), {"phase imbalance": s})).max(axis=1)
        for s in (0.0, 1.0)
    )
    # A negative sequence of 0.3 in phase opposition in phase A: |1 - 0.3|, |1 - 0.3 e^(+-2j pi/3)|.
    other = abs(1 - 0.3 * np.exp(2j * np.pi / 3))
    assert lame / sound == pytest.approx([0.7, other, other], rel=2e-3)  # harmonics of dead time


def test_currents_out_of_balance_pulsate_as_the_ripple_says():
    # Torque is the sum of each phase's current times its back-EMF per speed.
    actuator, torques = spun(2 * np.pi * 20, {"phase imbalance": 1.0}, force=1000.0)
    currents = phase_currents(torques.load, torques.angle, actuator, {"phase imbalance": 1.0})
    third = 2 * np.pi / 3 * np.arange(3)[:, np.newaxis]
    emf = -np.sin(POLE_PAIRS * torques.angle - third)
    torque = 2 / 3 * actuator.torque_constant * (currents * emf).sum(axis=0)
    expected = line(torques.ripple, 12, 2 * np.pi * 20 * TIMES) * 0.9  # the screw loses a tenth
    assert line(torque, 12, torques.angle) == pytest.approx(expected, rel=0.03)
