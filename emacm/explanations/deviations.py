"""How far the columns of a recording are from the training, in decibels where they are powers.

A column of a `BinTransformer` is a power, and its logarithm after a `FunctionTransformer` a level:
for these, differences are exact in dB, whatever scaling follows. Other columns differ by standard
deviations within the classes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.pipeline import FeatureUnion, Pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm.explanations.feature_traces import FeatureTrace
from emacm.explanations.step_names import names_of
from emacm.machine.fault_lines import FaultLines
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD

Array = NDArray[np.float64]

_POWER = np.inf  # stands for a column that is a power, and no logarithm of one
_PROBE = 10.0  # dB by which columns are changed, to find out how the positions depend on them
_EXACT = 1e-6  # relative deviation from a straight line


@dataclass(frozen=True)
class Deviations:
    """Differences of the columns of one recording from the training.

    Attributes
    ----------
    of_mean : ndarray of shape (n_columns,)
        From the mean of the nearest class.
    of_least, of_largest : ndarray of shape (n_columns,)
        From the least and the largest value of the training recordings; NaN if they are not
        known, as after a projection.
    in_decibels : ndarray of bool, shape (n_columns,)
        Unit of both: dB, or standard deviations within the classes.
    levels, mean_levels : ndarray of shape (n_columns,)
        Levels of the recording and of the nearest class [dB], NaN for other columns.
    """

    of_mean: Array
    of_least: Array
    of_largest: Array
    in_decibels: NDArray[np.bool_]
    levels: Array
    mean_levels: Array

    @property
    def outside(self) -> Array:
        """Deviations from the range of the training: positive above, negative below, 0 within."""
        below = np.where(self.of_least < 0, self.of_least, 0.0)
        inside = np.where(np.isnan(self.of_least), np.nan, below)
        return np.where(self.of_largest > 0, self.of_largest, inside)

    def columns(self) -> dict[str, Any]:
        """Return columns of a table: "deviation", "outside_training" and their "unit"."""
        units = np.where(self.in_decibels, "dB", "standard deviations")
        return {"deviation": self.of_mean, "outside_training": self.outside, "unit": units}


def find_deviations(
    trace: FeatureTrace,
    row: Array,
    scales: Array,
    references: tuple[Array, Array, Array],
    spread: Array,
) -> Deviations:
    """Determine how far a recording is from the training.

    Parameters
    ----------
    trace : FeatureTrace
        From the columns to the features.
    row : ndarray of shape (n_columns,)
        The recording.
    scales : ndarray of shape (n_columns,)
        Of `power_scales`.
    references : (ndarray, ndarray, ndarray), each of shape (n_positions,)
        Positions of the nearest class, and of the least and the largest training value; NaN where
        they are not known.
    spread : ndarray of shape (n_positions,)
        Standard deviations of the positions within the classes; NaN where they are not known.

    Returns
    -------
    Deviations
    """
    place = np.full(len(row), -1)
    place[trace.sources[::-1]] = np.arange(len(trace.sources))[::-1]
    known = place >= 0  # the others were dropped by a selection
    found = trace.positions(row[np.newaxis])[0]
    mean, low, high = (
        _in_decibels(trace, row, scales, found, reference)[place] for reference in references
    )
    exact = known & np.isfinite(mean)
    with np.errstate(invalid="ignore"):
        sigmas = [((found - reference) / spread)[place] for reference in references]
        mean, low, high = (
            np.where(exact, db, sigma) for db, sigma in zip((mean, low, high), sigmas, strict=True)
        )
    levels = np.where(exact, _levels(row, scales), np.nan)
    hidden = np.where(known, 1.0, np.nan)
    return Deviations(mean * hidden, low * hidden, high * hidden, exact, levels, levels - mean)


def power_scales(maker: Any, n_columns: int) -> Array:
    """Return what one unit of each column of a table is in dB.

    Parameters
    ----------
    maker : transformer or None
        The fitted step that makes the table.
    n_columns : int
        Number of its columns.

    Returns
    -------
    ndarray of shape (n_columns,)
        dB per unit of a logarithm of a power, inf for a power, NaN for anything else.
    """
    if isinstance(maker, BinTransformer | OrderPSD):
        return np.full(n_columns, _POWER)
    if isinstance(maker, FaultLines):  # levels in dB
        return np.ones(n_columns)
    if isinstance(maker, FeatureUnion):
        blocks = [step for _, step in maker.transformer_list if step != "drop"]
        widths = [len(names_of(step)) for step in blocks]
        parts = [power_scales(*pair) for pair in zip(blocks, widths, strict=True)]
        whole = np.concatenate([*parts, np.empty(0)])
        return whole if len(whole) == n_columns else np.full(n_columns, np.nan)
    scale: Any = np.nan
    for _, step in maker.steps if isinstance(maker, Pipeline) else ():
        if isinstance(step, BinTransformer | OrderPSD | FaultLines | FeatureUnion):
            scale = power_scales(step, len(names_of(step)))
        elif isinstance(step, FunctionTransformer):
            scale = np.where(np.isinf(scale), _decibels_per_unit(step), np.nan)
        elif step not in (None, "passthrough"):
            scale = np.nan
    return (
        np.resize(scale, n_columns)
        if np.size(scale) in (1, n_columns)
        else np.full(n_columns, np.nan)
    )


def _decibels_per_unit(logarithm: FunctionTransformer) -> float:
    """Return what one unit of a logarithm of a power is in dB; NaN if it is another function."""
    if logarithm.func is None:
        return _POWER
    powers = 10.0 ** np.arange(-3, 4)[:, np.newaxis]  # 10 dB apart
    with np.errstate(all="ignore"):
        try:
            values = logarithm.func(powers, **(logarithm.kw_args or {}))
            steps = np.diff(np.asarray(values, np.float64), axis=0)
        except (TypeError, ValueError, AttributeError):  # a function of DataFrames, for example
            return np.nan
        straight = np.ptp(steps) <= _EXACT * np.abs(steps).max()
    return float(_PROBE / steps.mean()) if straight and steps.any() else np.nan


def _levels(row: Array, scales: Array) -> Array:
    """Return the columns in dB."""
    with np.errstate(all="ignore"):
        return np.where(np.isinf(scales), 10 * np.log10(row), row * scales)


def _in_decibels(
    trace: FeatureTrace, row: Array, scales: Array, found: Array, reference: Array
) -> Array:
    """Return the differences from reference positions [dB]; NaN where they cannot be determined.

    Each position depends on one column, so that all can be changed at once.
    """
    power = np.isinf(scales)
    with np.errstate(all="ignore"):
        factor = 10 ** (_PROBE / 10)
        changed = [
            np.where(power, row * factor**sign, row + np.nan_to_num(sign * _PROBE / scales))
            for sign in (1, -1)
        ]
        up, down = (trace.positions(x[np.newaxis])[0] - found for x in changed)
        own_row, own_scale = row[trace.sources], scales[trace.sources]
        logarithmic = np.abs(up + down) <= _EXACT * np.abs(up)
        decibels = (found - reference) * _PROBE / up
        # In a position that is linear in the power, ten times the power adds nine times as much.
        linear = np.isinf(own_scale) & (np.abs(up + factor * down) <= _EXACT * np.abs(up))
        before = own_row - (found - reference) / up * (factor - 1) * own_row
        by_power = 10 * np.log10(own_row / before)
    result = np.where(logarithmic, decibels, np.where(linear, by_power, np.nan))
    return np.where(np.isnan(own_scale) | ~np.isfinite(result), np.nan, result)
