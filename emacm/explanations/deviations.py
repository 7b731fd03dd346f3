"""How far the columns of a recording are from the training, in decibels where they are powers.

A column of a `BinTransformer` is a power, and its logarithm after a `FunctionTransformer` a level:
for these, differences are exact in dB, whatever scaling follows. Other columns differ by standard
deviations within the classes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.explanations.opened_pipelines import (
    OpenedPipeline,
    TracedRecordings,
    apply_steps,
    one_recording,
)

Array = NDArray[np.float64]


def find_deviations(
    traced: TracedRecordings, mean: Array, spread: Array, *, low: Any = np.nan, high: Any = np.nan
) -> pd.DataFrame:
    """Determine how far a recording is from the training.

    Parameters
    ----------
    traced : TracedRecordings
        One recording.
    mean : ndarray of shape (n_columns,)
        Position of the nearest class.
    spread : ndarray of shape (n_columns,)
        Standard deviations of the positions within the classes; NaN where they are not known.
    low, high : ndarray of shape (n_columns,)
        Positions of the least and the largest training value; NaN where they are not known.

    Returns
    -------
    DataFrame of shape (n_columns, 5)
        "deviation" from the mean of the nearest class; "outside_training", that from the range of
        the training: positive above, negative below, 0 within; their "unit", "dB" or "standard
        deviations"; and "level" and "reference_level" of the class [dB]. NaN where they are not
        known.
    """
    row, scales = traced.table[0], traced.scales
    by_level = np.array([_in_decibels(traced, each) for each in (mean, low, high)])
    with np.errstate(all="ignore"):
        by_spread = [(traced.positions[0] - each) / spread for each in (mean, low, high)]
        level = np.where(np.isinf(scales), 10 * np.log10(row), row * scales)
    exact = np.isfinite(by_level[0])
    deviation, least, largest = np.where(exact, by_level, by_spread)
    table = pd.DataFrame({"deviation": deviation})
    table["outside_training"] = np.where(largest > 0, largest, np.minimum(least, 0))
    table["unit"] = np.where(exact, "dB", "standard deviations")
    table["level"] = np.where(exact, level, np.nan)
    return table.assign(reference_level=table["level"] - deviation)


def _in_decibels(traced: TracedRecordings, reference: Array) -> Array:
    """Return the differences from reference positions [dB]; NaN where they cannot be determined.

    Each position depends on its own column, so that all can be changed at once, by 10 dB.
    """
    row, scales, found = traced.table[0], traced.scales, traced.positions[0]
    power = np.isinf(scales)
    with np.errstate(all="ignore"):
        step = np.nan_to_num(10.0 / scales)
        changed = [np.where(power, row * 10, row + step), np.where(power, row / 10, row - step)]
        up, down = apply_steps(traced.elementwise, np.array(changed)) - found
        logarithmic = np.abs(up + down) <= 1e-6 * np.abs(up)
        decibels = (found - reference) * 10.0 / up
        # In a position that is linear in the power, ten times the power adds nine times as much.
        linear = power & (np.abs(up + 10 * down) <= 1e-6 * np.abs(up))
        by_power = -10 * np.log10(1 - (found - reference) / up * 9)
    result = np.where(logarithmic, decibels, np.where(linear, by_power, np.nan))
    return np.where(np.isnan(scales) | ~np.isfinite(result), np.nan, result)


PROJECTED = (
    "the features are projections of the bins, so that the bins that deviate are not determined; "
    "give training recordings as background"
)


def unknown_statements(table: pd.DataFrame) -> list[str]:
    """State which channels and orders of a recording deviate from the training, and how.

    Parameters
    ----------
    table : DataFrame
        Columns "column", "channel", "low", "high", those of `find_deviations`, and "contribution"
        to the distance; one row for each column of the table of the model.

    Returns
    -------
    list of str
        The most important first, at most five.
    """
    table = table.assign(weight=table["contribution"].abs())
    far = table[table["outside_training"].abs() > 1.0]
    stated = []
    for part in deviating_ranges(far, "outside_training"):
        peak = part.loc[part["outside_training"].abs().idxmax()]
        size = peak["outside_training"]
        limit = "above the training maximum" if size > 0 else "below the training minimum"
        up_to = "up to " if len(part) > 1 else ""
        text = f"{_place(part)} {up_to}{abs(size):.2g} {peak['unit']} {limit}"
        stated.append((part["weight"].sum(), text))
    stated.sort(key=lambda pair: -pair[0])
    if not stated:
        largest = ", ".join(map(repr, table.nlargest(3, "weight")["column"]))
        return [f"no column is far outside the training; together they are, above all {largest}"]
    return [text for weight, text in stated[:5] if weight >= 0.03 * stated[0][0]]


def deviating_ranges(table: pd.DataFrame, size: str) -> list[pd.DataFrame]:
    """Divide deviating columns into ranges of adjacent bins, and single features.

    Parameters
    ----------
    table : DataFrame
        Columns "channel", "low", "high", "unit" and `size`, of those columns that deviate.
    size : str
        Name of the deviation.

    Returns
    -------
    list of DataFrame
        Bins that deviate to the same side, without those that deviate by 6 dB less than the
        largest: they may be leakage.
    """
    table = table.sort_values(["channel", "low"], kind="stable")
    before = table.shift()
    joined = (
        (table["channel"] == before["channel"])
        & (table["low"] <= before["high"] + 1e-9)
        & (table[size] * before[size] > 0)
    )
    ranges = [part for _, part in table.groupby((~joined).cumsum())]
    return [part[part[size].abs() > part[size].abs().max() - 6.0] for part in ranges]


def second_state_statement(state: Any, second: Any, raised: pd.DataFrame | None = None) -> str:
    """State that a recording has lines of a second state.

    Parameters
    ----------
    state, second : label
        The decided state, and the one whose lines are also there.
    raised : DataFrame, optional
        Columns "column", "channel", "low", "high", "deviation" and "unit" of what is raised above
        the decided state.

    Returns
    -------
    str

    Examples
    --------
    >>> second_state_statement("bearing", "screw")
    "lines that 'bearing' does not explain, as of 'screw'"
    """
    text = f"lines that {str(state)!r} does not explain, as of {str(second)!r}"
    if raised is None or not len(raised):
        return text
    listed = [
        f"{_place(part)} {part['deviation'].max():.2g} {part['unit'].iloc[0]} higher"
        for part in deviating_ranges(raised, "deviation")
    ]
    return f"{text}: {', '.join(listed)}"


def _place(part: pd.DataFrame) -> str:
    """Return the orders of adjacent bins in words, or the name of a feature."""
    first = part.iloc[0]
    if np.isnan(first["low"]):
        return repr(first["column"])
    return f"orders {part['low'].min():g} to {part['high'].max():g} of {first['channel']!r}"


def class_deviations(
    pipeline: Any, x: Any, reference: Any, *, background: Any = None
) -> pd.DataFrame:
    """Return how far each bin or feature of a recording is from the mean of a class.

    Unlike the contributions of `explain_decision`, this does not depend on the other classes: a
    line that a fault raises is raised, also if another fault raises it more.

    Parameters
    ----------
    pipeline : Pipeline, CostSensitiveGaussianBayes, fitted search or ConditionRouter
        As for `explain_decision`.
    x : Recording, or one row of a table
        Input of the pipeline.
    reference : label
        The class.
    background : recordings or table, optional
        Recordings of this class. Default: the mean and the covariance that the classifier has
        learned, which are those of the bins unless they were projected (PCA).

    Returns
    -------
    DataFrame
        One row for each bin or feature: "column", "channel", "low" and "high" [orders],
        "deviation" from the mean of the class, its "unit" ("dB" for powers, exactly, and "standard
        deviations" for other features), "level" of the recording and "reference_level" of the class
        [dB; NaN for other features], and "limit", which no deviation of the class exceeds, on
        either side: four standard deviations, at least 3 dB; inf where this one is less.

    Raises
    ------
    TypeError, ValueError
        As `explain_decision`; or if the features are projections and there is no `background`.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import FunctionTransformer
    >>> X = pd.DataFrame({"torque@0-1": [1.0, 2, 3, 4], "torque@1-2": [0.0, 1, 8, 9]})
    >>> model = CostSensitiveGaussianBayes(shrinkage=0.5).fit(X, ["new", "new", "old", "old"])
    >>> class_deviations(model, X.iloc[[3]], "new")["deviation"].round(1).tolist()
    [3.5, 12.0]
    """
    x = one_recording(x)
    opened = OpenedPipeline.of(pipeline, x)
    traced = opened.traced(x)
    if background is None:
        mean, spread = _learned(opened.classifier, traced.is_linear, reference)
    else:
        others = apply_steps(traced.elementwise, opened.table(background)[0])
        mean, spread = others.mean(axis=0), others.std(axis=0)
    # Hundreds of bins are looked at: four standard deviations.
    found = find_deviations(traced, mean, spread, low=mean - 4 * spread, high=mean + 4 * spread)
    outside = found.pop("outside_training")
    limit = np.maximum((found["deviation"] - outside).abs(), 3.0)
    return traced.bins.join(found.assign(limit=limit.where(outside.abs() > 0, np.inf)))


def _learned(
    classifier: CostSensitiveGaussianBayes, is_projected: bool, reference: Any
) -> tuple[Array, Array]:
    """Return mean and standard deviations of the positions of a class, as learned."""
    if is_projected:
        raise ValueError(f"{PROJECTED}.")
    code = classifier.classes_.tolist().index(reference)
    covariance = np.asarray(classifier.covariances_)
    own = covariance if classifier.covariance == "tied" else covariance[code]
    return classifier.means_[code], np.sqrt(own if own.ndim == 1 else np.diag(own))
