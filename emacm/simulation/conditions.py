"""Commands of the laboratory bench and scales of its transducers: Tables 4.2 and 4.3."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

INCH = 0.0254  # m
POUND = 4.4482216152605  # N, of force
RPM = 2 * np.pi / 60  # rad/s


class Condition(NamedTuple):
    """One row of Table 4.3 of the thesis: a position command and a load.

    Attributes
    ----------
    shape : {"sine", "triangle"}
        Shape of the position command.
    bias, amplitude : float
        Centre and amplitude of the position [in].
    frequency : float
        Frequency of the command [Hz].
    spring_rate : float
        Load force per position [lbf/in], relative to position 0 (assumed: the middle of the
        stroke, where the LVDT reads 0).
    load_bias : float
        Load force at position 0 [lbf].
    """

    shape: str
    bias: float
    amplitude: float
    frequency: float
    spring_rate: float
    load_bias: float


CONDITIONS: Mapping[int, Condition] = MappingProxyType(
    {
        1: Condition("sine", 1.90, 0.10, 0.70, 0.0, 116.0),
        2: Condition("triangle", 1.40, -0.90, 1.00, 0.0, 278.0),
        3: Condition("triangle", 0.25, 2.05, 2.14, 0.0, 660.0),
        4: Condition("sine", 0.10, -2.20, 0.70, -1210.0, -1867.0),
        5: Condition("triangle", 1.15, -1.55, 0.41, -550.0, 255.0),
    }
)


class Transducer(NamedTuple):
    """One row of Table 4.2 of the thesis.

    Attributes
    ----------
    scale : float
        Units per volt.
    peak : float
        Full scale, in the same units.
    unit : str
        Unit of the channel.
    """

    scale: float
    peak: float
    unit: str


TRANSDUCERS: Mapping[str, Transducer] = MappingProxyType(
    {
        "lvdt": Transducer(0.5, 3.0, "in"),
        "velocity": Transducer(500 * RPM, 4700 * RPM, "rad/s"),
        "current": Transducer(5.0, 50.0, "A"),
        "accelerometer": Transducer(1.0, 10.0, "g"),
        "load": Transducer(1000.0, 5500.0, "lbf"),
    }
)


def position_command(
    condition: Condition, times: NDArray[np.floating], phase: float = 0.0
) -> NDArray[np.floating]:
    """Return the commanded position.

    Parameters
    ----------
    condition : Condition
        A row of Table 4.3.
    times : ndarray of shape (n_times,)
        Times [s].
    phase : float
        Phase of the command at time 0 [rad].

    Returns
    -------
    ndarray of shape (n_times,)
        Position [in].

    Examples
    --------
    >>> position_command(CONDITIONS[3], np.array([0.0, 0.25, 0.5, 0.75]) / 2.14).round(9)
    array([ 0.25,  2.3 ,  0.25, -1.8 ])
    """
    wave = np.sin(2 * np.pi * condition.frequency * times + phase)
    if condition.shape == "triangle":
        wave = 2 / np.pi * np.arcsin(wave)
    return condition.bias + condition.amplitude * wave


def load_force(
    condition: Condition, position: NDArray[np.floating], share: float = 1.0
) -> NDArray[np.floating]:
    """Return the force of the load actuator against motion to larger positions.

    Parameters
    ----------
    condition : Condition
        A row of Table 4.3.
    position : ndarray of shape (n_times,)
        Position of the rod [in].
    share : float
        Actual load relative to the commanded load.

    Returns
    -------
    ndarray of shape (n_times,)
        Force [lbf].

    Examples
    --------
    >>> load_force(CONDITIONS[5], np.array([-0.4, 2.7])).round(6)
    array([  475., -1230.])
    """
    return share * (condition.load_bias + condition.spring_rate * position)


def load_error(n_times: int, fs: float, rng: np.random.Generator) -> NDArray[np.floating]:
    """Return the control error of the load actuator: 3 lbf RMS below 10 Hz (assumed).

    Parameters
    ----------
    n_times : int
        Number of samples.
    fs : float
        Sampling rate [Hz].
    rng : Generator
        Random numbers of the run.

    Returns
    -------
    ndarray of shape (n_times,)
        Force [lbf].
    """
    decay = np.exp(-2 * np.pi * 10.0 / fs)
    white = 3.0 * np.sqrt(1 - decay**2) * rng.standard_normal(n_times)
    white[0] /= np.sqrt(1 - decay**2)  # stationary from the first sample
    return filters.lfilter([1.0], [1.0, -decay], white)
