"""Lines that are locked to the shaft, with the phase at which they stand on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_number, check_signal

__all__ = ["Harmonics", "check_orders", "harmonic_coefficients", "whole_revolutions"]

Array = NDArray[np.float64]

_TURN = 2 * np.pi


class Harmonics(NamedTuple):
    """Coefficients of cosines and sines, each of shape (n_orders,), and the length of the fit.

    Coefficients are in the unit of the signal; a cosine of -2 and a sine of 0 is a line whose
    crests stand half a cycle from the zero of the shaft.
    """

    cosines: Array
    sines: Array
    revolutions: float


def harmonic_coefficients(
    angles: Sequence[ArrayLike], signals: Sequence[ArrayLike], orders: Sequence[float]
) -> Harmonics:
    """Fit cosines and sines of the shaft angle to stretches of a signal, by least squares.

    Parameters
    ----------
    angles : sequence of array-like of shape (n_samples,)
        Shaft angle in each stretch [rad], rising or falling, evenly sampled or not.
    signals : sequence of array-like of shape (n_samples,)
        Signal there, in any unit U; stretches may be unequally long.
    orders : sequence of float
        Orders, in cycles per revolution.

    Returns
    -------
    Harmonics
        `cosines` and `sines` [U], of shape (n_orders,), of ``signal = level + trend * angle
        + Σ c cos(order * angle) + s sin(order * angle)``, where each stretch has a level and a
        trend of its own; and `revolutions`, the length of all stretches.

    Raises
    ------
    TypeError, ValueError
        If the shapes do not fit, an order is not positive, or the samples are too few or span
        too little to tell the orders, the levels and the trends apart.

    Notes
    -----
    Each sample counts by the angle that it stands for, so that over whole revolutions the
    coefficients are those of the synchronous average, and other orders stay out, even if the
    speed changes. At even angles, but for the trend, they are Fourier coefficients of the average
    revolution (assumed: no source is followed).

    Examples
    --------
    >>> angle = 2 * np.pi * np.linspace(0, 5, 500)
    >>> signal = 7 + 2 * np.cos(angle) + np.sin(angle) - np.cos(2 * angle) - 3 * np.sin(2 * angle)
    >>> found = harmonic_coefficients([angle], [signal], (1, 2))
    >>> found.cosines.round(9).tolist(), found.sines.round(9).tolist()
    ([2.0, -1.0], [1.0, -3.0])
    """
    chosen = np.array(check_orders(orders))
    models, targets, run, n_steps = [], [], 0.0, 0
    for angle, signal in zip(angles, signals, strict=True):
        theta, x = _checked(angle, signal)
        farthest = np.maximum.accumulate(np.abs(theta - theta[0]))
        waves = chosen[:, np.newaxis] * theta
        rows = np.column_stack([np.cos(waves).T, np.sin(waves).T, x])
        left = _without_trend(rows, theta, np.sqrt(np.gradient(farthest)))
        models.append(left[:, :-1])
        targets.append(left[:, -1])
        run, n_steps = run + farthest[-1] / _TURN, n_steps + len(theta) - 1
    _check_density(n_steps, run, chosen)
    solution, _, rank, _ = np.linalg.lstsq(
        np.concatenate(models), np.concatenate(targets), rcond=1e-9
    )
    if rank < len(solution):
        raise ValueError(
            f"{n_steps + len(models)} samples over {run:.4g} revolutions do not tell the orders "
            f"{chosen.tolist()} apart from each other and from a trend. Use longer stretches or "
            f"fewer orders."
        )
    return Harmonics(solution[: len(chosen)], solution[len(chosen) :], float(run))


def whole_revolutions(travel: ArrayLike, part: int = 0, n_parts: int = 1) -> slice | None:
    """Find the samples of the most whole revolutions in the middle of a part of a stroke.

    Parameters
    ----------
    travel : array-like of shape (n_samples,)
        Angle run [rad], from 0 upwards.
    part, n_parts : int
        Which of how many equal parts of the stroke, from 0.

    Returns
    -------
    slice or None
        None if the part holds no whole revolution, or a single sample.

    Examples
    --------
    >>> whole_revolutions(2 * np.pi * np.arange(0, 5.5, 0.25))
    slice(1, 21, None)
    """
    run = np.maximum.accumulate(check_signal(travel, "travel", min_length=1))
    if len(run) < 2:
        return None
    # A sample stands for the angle up to the next one, so the last ends beyond the last sample.
    step = (run[-1] - run[0]) / (len(run) - 1)
    low, high = run[0] + (run[-1] + step - run[0]) * np.array([part, part + 1]) / n_parts
    revolutions = np.floor((high - low) / _TURN + 1e-6)
    if revolutions < 1:
        return None
    spare = (high - low - revolutions * _TURN) / 2
    first, last = np.searchsorted(run, np.array([low + spare, high - spare]) - 1e-6 * step)
    return slice(int(first), int(last)) if last - first > 1 else None


def check_orders(orders: Any) -> tuple[float, ...]:
    """Return orders as floats: positive, each once."""
    if isinstance(orders, str) or not isinstance(orders, Sequence | np.ndarray):
        raise TypeError(f"orders must be a list of numbers such as [1, 2], got {orders!r}.")
    found = tuple(check_number(order, "an order", above=0) for order in orders)
    if not found or len(set(found)) < len(found):
        raise ValueError(f"orders must hold each order once, got {list(found)}.")
    return found


def _checked(angle: ArrayLike, signal: ArrayLike) -> tuple[Array, Array]:
    theta = check_signal(angle, "angle").astype(np.float64)
    x = check_signal(signal, "signal").astype(np.float64)
    if len(x) != len(theta):
        raise ValueError(f"a signal of {len(x)} samples does not fit {len(theta)} angles.")
    return theta, x


def _without_trend(rows: Array, theta: Array, weight: Array) -> Array:
    """Weigh columns, and take a level and a trend out of each of them."""
    trend = np.column_stack([np.ones_like(theta), theta - theta.mean()]) * weight[:, np.newaxis]
    basis, size = np.linalg.qr(trend / (np.linalg.norm(trend, axis=0) + np.finfo(float).tiny))
    basis = basis[:, np.abs(np.diag(size)) > 1e-9]
    weighted = rows * weight[:, np.newaxis]
    return weighted - basis @ (basis.T @ weighted)


def _check_density(n_steps: int, revolutions: float, orders: Array) -> None:
    """Refuse orders of which there are less than two samples a cycle."""
    if not revolutions > 0:
        raise ValueError("the shaft does not turn, so that nothing is locked to it.")
    density = n_steps / revolutions
    if not orders.max() < density / 2:
        raise ValueError(
            f"order {orders.max():g} does not exist in samples of which there are {density:.4g} "
            f"in a revolution; they hold orders below {density / 2:.4g}. Choose lower orders."
        )
