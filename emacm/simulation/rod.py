"""From the shaft to the rod: screw, elasticity and lash."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from emacm.simulation.actuator import Actuator
from emacm.simulation.conditions import INCH, POUND

_LASH = 0.01  # in, at severity 1; assumed: a screw worn out
_HELD = 10.0  # lbf by which friction holds the nut at its flank; assumed
_CROSSING = 0.002  # s, of the nut from flank to flank; assumed


def rod_position(
    angle: NDArray[np.floating],
    force: NDArray[np.floating],
    actuator: Actuator,
    backlash: float,
    fs: float,
) -> tuple[NDArray[np.floating], NDArray[np.intp]]:
    """Return where the rod is, and when the nut strikes its other flank.

    The rod gives way in proportion to its load. With lash, the nut lies at the side to which the
    load pushes it, and crosses over when the load changes its sign: under a load of one
    sign (conditions 1 to 3) lash does not show, as in machines.

    Parameters
    ----------
    angle : ndarray of shape (n_times,)
        Shaft angle, 0 at position 0 [rad].
    force : ndarray of shape (n_times,)
        Load against positive motion [lbf].
    actuator : Actuator
        Constants.
    backlash : float
        Severity in [0, 1]; 1 is a lash of 0.01 in.
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    position : ndarray of shape (n_times,)
        Position of the rod [in].
    knocks : ndarray of shape (n_knocks,), of int
        Samples of the strikes; none without lash.

    Examples
    --------
    >>> turned = np.full(9600, 2 * np.pi)
    >>> force = np.where(np.arange(9600) < 4800, 100.0, -100.0)
    >>> position, knocks = rod_position(turned, force, Actuator(), 1.0, 48_000)
    >>> position[[0, -1]].round(3), knocks
    (array([0.195, 0.205]), array([4800]))
    """
    position = angle / actuator.angle_per_inch - force * POUND / actuator.stiffness / INCH
    if not backlash:
        return position, np.zeros(0, dtype=np.intp)
    side = _side(force)
    decay = np.exp(-1 / (_CROSSING * fs))
    eased, _ = filters.lfilter([1 - decay], [1, -decay], side, zi=[decay * side[0]])
    return position - _LASH / 2 * backlash * eased, np.flatnonzero(np.diff(side)) + 1


def _side(force: NDArray[np.floating]) -> NDArray[np.floating]:
    """Sign of the force, held while friction could hold the nut."""
    sure = np.flatnonzero(np.abs(force) > _HELD)
    if not len(sure):
        return np.ones_like(force)
    last = np.searchsorted(sure, np.arange(len(force)), side="right") - 1
    return np.sign(force[sure[np.maximum(last, 0)]])
