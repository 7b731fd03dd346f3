"""Motion of the shaft from the position command, and of the rod from the shaft."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from emacm import _kernels
from emacm.simulation.actuator import PEAK_SPEED, Actuator
from emacm.simulation.conditions import INCH, POUND, Condition, load_force, position_command
from emacm.simulation.drive import drive_limits
from emacm.simulation.faults import FAULTS
from emacm.simulation.waves import BLOCK

Coefficients = tuple[float, float, float]

_CONTROL_RATE = 2000.0  # Hz, assumed
_HEADROOM = 0.99  # the command is limited to 99 % of the peak speed, because ripple adds to it
_JAM = FAULTS["jam"]
_HOLDING_FORCE = 10.0  # lbf: friction that holds the nut at its flank; assumed
_CROSSING_TIME = 0.002  # s, of the nut from flank to flank; assumed


class Motion(NamedTuple):
    """Motion of the shaft without torque ripple.

    Attributes
    ----------
    times : ndarray of shape (n_times,)
        Times [s]; the recording starts at 0.
    angle, velocity, acceleration : ndarray of shape (n_times,)
        Shaft angle [rad], 0 at position 0, and its derivatives [rad/s], [rad/s²].
    """

    times: NDArray[np.floating]
    angle: NDArray[np.floating]
    velocity: NDArray[np.floating]
    acceleration: NDArray[np.floating]


def bench_motion(
    condition: Condition,
    actuator: Actuator,
    times: NDArray[np.floating],
    *,
    phase: float = 0.0,
    load_share: float = 1.0,
    jam: float = 0.0,
) -> Motion:
    """Return the motion with which the actuator follows its command.

    A proportional position controller commands a velocity of at most 99 % of 4572 RPM; the
    velocity loop follows with a first-order lag, unless the required torque exceeds the limits
    of current or voltage (thesis, section 4.2, names the loops; gains are assumed). The command of
    condition 3 exceeds the peak speed at leads below 0.23 in, and 220 V allow 0.168 in at most:
    Tables 4.1 and 4.3 cannot both hold, and the rod does not reach its commanded stroke.

    Parameters
    ----------
    condition : Condition
        A row of Table 4.3.
    actuator : Actuator
        Constants.
    times : ndarray of shape (n_times,)
        Evenly spaced times [s]. The simulation starts one period, and at least 1 s, earlier.
    phase : float
        Phase of the command at time 0 [rad].
    load_share : float
        Actual load relative to the commanded load.
    jam : float
        Severity of a jam in [0, 1].

    Returns
    -------
    Motion

    Examples
    --------
    >>> from emacm.simulation.conditions import CONDITIONS, RPM
    >>> motion = bench_motion(CONDITIONS[3], Actuator(), np.arange(48_000) / 48_000)
    >>> round(float(motion.velocity.max()) / RPM)
    4526
    """
    # The derivatives of the last interval need one more control step.
    before = max(1.0, 1 / condition.frequency) - float(times[0])
    n_before = int(np.ceil(before * _CONTROL_RATE))
    n_after = int(np.ceil(float(times[-1]) * _CONTROL_RATE)) + 2
    steps = np.arange(-n_before, n_after) / _CONTROL_RATE
    targets = position_command(condition, steps, phase) * actuator.angle_per_inch
    start, velocities = _follow(targets, condition, actuator, load_share, jam)
    angle, velocity, acceleration = _between_steps(velocities, (times - steps[0]) * _CONTROL_RATE)
    angle /= _CONTROL_RATE
    angle += start
    acceleration *= _CONTROL_RATE
    return Motion(times, angle, velocity, acceleration)


def _between_steps(
    velocities: NDArray[np.floating], places: NDArray[np.floating]
) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
    """Return angle, velocity and acceleration between the steps of the control loop.

    A quadratic spline whose coefficients are the velocities of the steps: its acceleration is their
    linear interpolation, so that neither speed nor torque overshoots its limit. `places` are times
    in steps; the angle is 0 at the first step.
    """
    # Pieces of the spline join halfway between the steps.
    c = np.concatenate((velocities[:1], velocities))
    value, slope = (c[1:] + c[:-1]) / 2, np.diff(c)
    curve = np.diff(slope, append=slope[-1:]) / 2
    whole = value + slope / 2 + curve / 3
    turned = np.concatenate(([0.0], np.cumsum(whole)[:-1]))
    angle, velocity, acceleration = (np.empty_like(places) for _ in range(3))
    for start in range(0, len(places), BLOCK):
        block = slice(start, start + BLOCK)
        x = places[block] + 0.5
        number = x.astype(np.intp)
        x -= number
        a, b, d = value[number], slope[number], curve[number]
        angle[block] = turned[number] + x * (a + x * (b / 2 + x * d / 3))
        velocity[block] = a + x * (b + x * d)
        acceleration[block] = b + 2 * x * d
    return angle, velocity, acceleration


def _follow(
    targets: NDArray[np.floating],
    condition: Condition,
    actuator: Actuator,
    load_share: float,
    jam: float,
) -> tuple[float, NDArray[np.floating]]:
    """Return the first angle and the velocity at each control step."""
    resists = [
        float(load_force(condition, place, load_share)) * POUND * actuator.torque_per_force
        for place in (np.array(0.0), np.array(1.0))
    ]
    velocities = _kernels.loops.follow(
        targets,
        1 / _CONTROL_RATE,
        (
            actuator.position_gain,
            min(1.0, 2 * np.pi * actuator.velocity_bandwidth / _CONTROL_RATE),
            _HEADROOM * PEAK_SPEED,
            actuator.inertia,
        ),
        (resists[0], (resists[1] - resists[0]) / actuator.angle_per_inch),
        (actuator.coulomb, actuator.viscous, 1 / actuator.efficiency - 1),
        (
            jam * _JAM.friction * actuator.max_torque,
            _JAM.place * actuator.angle_per_inch,
            _JAM.width * actuator.angle_per_inch,
        ),
        drive_limits(actuator),
    )
    return float(targets[0]), velocities


def jam_torque(angle: NDArray[np.floating], actuator: Actuator, jam: float) -> NDArray[np.floating]:
    """Return the friction torque of a jam [N m]: a Gaussian over the position (assumed).

    Parameters
    ----------
    angle : ndarray of shape (n_times,)
        Shaft angle, 0 at position 0 [rad].
    actuator : Actuator
        Constants.
    jam : float
        Severity in [0, 1]; at 1 the peak is 0.6 of the torque limit.

    Returns
    -------
    ndarray of shape (n_times,)

    Examples
    --------
    >>> actuator = Actuator()
    >>> at_jam = 1.9 * actuator.angle_per_inch
    >>> (jam_torque(np.array([0.0, at_jam]), actuator, 0.5) / actuator.max_torque).round(6)
    array([0. , 0.3])
    """
    if not jam:
        return np.zeros_like(angle)
    away = (angle / actuator.angle_per_inch - _JAM.place) / _JAM.width
    return jam * _JAM.friction * actuator.max_torque * np.exp(-(away**2))


def rod_position(
    angle: NDArray[np.floating],
    force: NDArray[np.floating],
    actuator: Actuator,
    backlash: float,
    fs: float,
) -> tuple[NDArray[np.floating], NDArray[np.intp]]:
    """Return the position of the rod, and the impacts of the nut on its opposite flank.

    The rod is elastic. With backlash, the load presses the nut against one flank, and the nut
    crosses to the other when the load changes its sign: under a load of constant sign
    (conditions 1 to 3) backlash has no visible effect, as on real machines.

    Parameters
    ----------
    angle : ndarray of shape (n_times,)
        Shaft angle, 0 at position 0 [rad].
    force : ndarray of shape (n_times,)
        Load against positive motion [lbf].
    actuator : Actuator
        Constants.
    backlash : float
        Severity in [0, 1]; 1 is a clearance of 0.01 in.
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    position : ndarray of shape (n_times,)
        Position of the rod [in].
    knocks : ndarray of shape (n_knocks,), of int
        Samples of the impacts; none without backlash.

    Examples
    --------
    >>> angle = np.full(9600, 2 * np.pi)
    >>> force = np.where(np.arange(9600) < 4800, 100.0, -100.0)
    >>> position, knocks = rod_position(angle, force, Actuator(), 1.0, 48_000)
    >>> position[[0, -1]].round(3), knocks
    (array([0.152, 0.163]), array([4800]))
    """
    position = angle / actuator.angle_per_inch - force * POUND / actuator.stiffness / INCH
    if not backlash:
        return position, np.zeros(0, dtype=np.intp)
    side = _side(force)
    decay = np.exp(-1 / (_CROSSING_TIME * fs))
    eased, _ = filters.lfilter([1 - decay], [1, -decay], side, zi=[decay * side[0]])
    position = position - FAULTS["backlash"].backlash / 2 * backlash * eased
    return position, np.flatnonzero(np.diff(side)) + 1


def _side(force: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the sign of the force, unchanged while friction can hold the nut."""
    certain = np.flatnonzero(np.abs(force) > _HOLDING_FORCE)
    if not len(certain):
        return np.ones_like(force)
    last = np.searchsorted(certain, np.arange(len(force)), side="right") - 1
    return np.sign(force[certain[np.maximum(last, 0)]])


def responses(
    systems: Sequence[tuple[Coefficients, Coefficients]], signal: NDArray[np.floating], fs: float
) -> NDArray[np.floating]:
    """Return the responses of up to three linear systems of second order, at rest at the start.

    Parameters
    ----------
    systems : sequence of (above, below)
        Coefficients of s², s and 1 in the numerator and the denominator of each.
    signal : ndarray of shape (n_times,)
        Their input.
    fs : float
        Sampling rate [Hz]; the bilinear transform maps s to z.

    Returns
    -------
    ndarray of shape (n_systems, n_times)

    Examples
    --------
    >>> omega = 2 * np.pi * 5
    >>> step = responses([((0, 0, omega**2), (1, 2 * omega, omega**2))], np.ones(1000), 1000.0)
    >>> step[:, [0, 20, -1]].round(3)
    array([[0.   , 0.137, 1.   ]])
    """
    double = 2 * fs
    digital = [
        [(q * double + p) * double + r, 2 * (r - q * double**2), (q * double - p) * double + r]
        for system in systems
        for q, p, r in system
    ]
    b, a = np.array(digital[::2]), np.array(digital[1::2])
    return _kernels.loops.resonate(b / a[:, :1], a / a[:, :1], signal)
