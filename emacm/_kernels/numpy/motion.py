"""Loops over the motion of the shaft, in NumPy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]

_BLOCK = 1 << 15  # samples of the velocity that are integrated at a time


def set_checkpoints(
    velocity: Array, half_step: float, stride: int, angles: Array, lowest: Array, highest: Array
) -> None:
    """Integrate a velocity once, and keep the angle at every `stride`-th sample.

    Parameters
    ----------
    velocity : ndarray of shape (n_times,)
        Velocity [rad/s]; contiguous and read-only, so that one kind of array is compiled for.
    half_step : float
        Half a sampling interval [s].
    stride : int
        Samples of a section; the last section may be shorter.
    angles : ndarray of shape (n_sections,)
        Set to the angle at the first sample of each section [rad], accumulated from 0 sample by
        sample, so that it equals a cumulative sum over the whole velocity bit for bit.
    lowest, highest : ndarray of shape (n_sections,)
        Set to the range of the velocity in each section [rad/s].
    """
    total = 0.0
    at_once = max(1, _BLOCK // stride) * stride
    for start in range(0, len(velocity), at_once):
        part = velocity[start : start + at_once + 1]
        angle = np.empty(len(part))
        integrate(part, half_step, np.array([total]), len(part), angle)
        sections = slice(start // stride, (start + at_once) // stride)
        angles[sections] = angle[: min(at_once, len(velocity) - start) : stride]
        total = float(angle[-1])
    starts = np.arange(0, len(velocity), stride)
    lowest[:] = np.minimum.reduceat(velocity, starts)
    highest[:] = np.maximum.reduceat(velocity, starts)


def integrate(velocity: Array, half_step: float, starts: Array, stride: int, angle: Array) -> None:
    """Integrate a velocity by the trapezoidal rule, section by section, in float64.

    Parameters
    ----------
    velocity : ndarray of shape (n_times,)
        Velocity [rad/s], as for `set_checkpoints`.
    half_step : float
        Half a sampling interval [s].
    starts : ndarray of shape (n_sections,)
        Angle at the first sample of each section [rad]; the integral over the sections before has
        the same value.
    stride : int
        Samples of a section; the last section may be shorter.
    angle : ndarray of shape (n_times,)
        Set to the angle [rad].
    """
    speed = velocity.astype(np.float64)
    angle[0] = starts[0]
    np.add(speed[1:], speed[:-1], out=angle[1:])
    angle[1:] *= half_step
    np.cumsum(angle, out=angle)
