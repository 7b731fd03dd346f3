"""Control loop and resonances of the simulated bench.

The control loop is nonlinear and therefore computed step by step, here with Python floats: about
1 us per step. `emacm._kernels.numba` compiles the same functions.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, exp, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.floating]
Limits = tuple[float, ...]


def follow(
    targets: Array,
    dt: float,
    control: tuple[float, float, float, float],
    load: tuple[float, float],
    friction: tuple[float, float, float],
    jam: tuple[float, float, float],
    drive: Limits,
) -> Array:
    """Return the velocity of a shaft that follows an angle, at each control step.

    Parameters
    ----------
    targets : ndarray of shape (n_steps,)
        Commanded angle [rad]; the shaft starts there, at rest.
    dt : float
        Time of a step [s].
    control : (float, float, float, float)
        Gain of the position loop [1/s], part of the difference of the velocity that is corrected
        in a step, limit of the velocity [rad/s], inertia [kg m²].
    load : (float, float)
        Torque of the load at angle 0 [N m], and its slope [N m/rad].
    friction : (float, float, float)
        Coulomb friction [N m], viscous friction [N m s/rad], and part of the load that is lost.
    jam : (float, float, float)
        Largest friction of a jam [N m], its angle and its width [rad].
    drive : tuple of float
        Limits of the drive, as for `limited_torque`.

    Returns
    -------
    ndarray of shape (n_steps,)
        Velocity [rad/s].
    """
    velocities = [0.0] * len(targets)
    step_through(targets.tolist(), dt, control, load, friction, jam, drive, velocities)
    return np.array(velocities)


def step_through(
    targets: Sequence[float],
    dt: float,
    control: tuple[float, float, float, float],
    load: tuple[float, float],
    friction: tuple[float, float, float],
    jam: tuple[float, float, float],
    drive: Limits,
    velocities: Any,
) -> None:
    """Do as `follow`, and set `velocities`, a list or an array."""
    gain, nearer, limit, inertia = control
    at_0, per_rad = load
    coulomb, viscous, lost = friction
    jammed, jam_angle, jam_width = jam
    slow, part = drive[6:]
    angle, velocity = targets[0], 0.0
    for step in range(len(targets)):
        velocities[step] = velocity
        wanted = gain * (targets[step] - angle)
        if not -limit <= wanted <= limit:
            wanted = copysign(limit, wanted)
        change = nearer * (wanted - velocity)
        needed, speed = at_0 + per_rad * angle, abs(velocity)
        braking = coulomb + viscous * speed + lost * abs(needed)
        if jammed:
            away = (angle - jam_angle) / jam_width
            braking += jammed * exp(-(away * away))
        torque = inertia * change / dt + needed + copysign(braking, velocity)
        if speed > slow or not -part <= torque <= part:  # else within all limits
            limited = limited_torque(torque, velocity, drive)
            if limited != torque:  # the limited torque drives; friction can only brake
                driven = velocity + (limited - needed) * dt / inertia
                left = copysign(max(abs(driven) - braking * dt / inertia, 0.0), driven)
                change = min(max(left, -limit), limit) - velocity
        angle += dt * (velocity + change / 2)
        velocity += change


def limited_torque(torque: float, velocity: float, drive: Limits) -> float:
    """Limit a torque by the current and the voltage of the drive.

    Parameters
    ----------
    torque, velocity : float
        Motor torque [N m] and shaft speed [rad/s].
    drive : tuple of float
        Torque constant [N m/A], EMF constant [V s/rad], resistance [ohm] and inductance times
        pole pairs [H] of a phase, allowed peak voltage of a phase [V] and largest torque [N m];
        then a speed [rad/s] and a torque [N m] up to which nothing is limited.

    Returns
    -------
    float
        The nearest torque for which current and voltage are allowed [N m].
    """
    constant, emf_constant, resistance, inductance, allowed, most = drive[:6]
    torque = min(max(torque, -most), most)
    emf, reactance = emf_constant * abs(velocity), inductance * abs(velocity)
    if (resistance + reactance) * abs(torque) <= constant * (allowed - emf):
        return torque  # even if the voltages were in phase
    impedance = resistance * resistance + reactance * reactance
    inner = emf * resistance * (emf * resistance) + impedance * (allowed * allowed - emf * emf)
    root = sqrt(max(inner, 0.0))
    side = copysign(constant / impedance, velocity)
    one, other = side * (-emf * resistance + root), side * (-emf * resistance - root)
    return min(max(torque, min(one, other)), max(one, other))


def resonate(b: Array, a: Array, signal: Array) -> Array:
    """Filter a signal by up to three filters of second order, each by itself.

    Parameters
    ----------
    b, a : ndarray of shape (n_filters, 3)
        Numerators and denominators, as for `scipy.signal.lfilter`; the first of `a` is 1.
    signal : ndarray of shape (n_times,)
        Signal; the filters start at rest.

    Returns
    -------
    ndarray of shape (n_filters, n_times)
    """
    return np.stack([lfilter(one, other, signal) for one, other in zip(b, a, strict=True)])
