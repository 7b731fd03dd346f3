"""Sentences on what a prediction of the remaining life is based on."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.monitoring.life_calibration import BEFORE_ONSET, SAME_AGE
from emacm.monitoring.unit_histories import History

Array = NDArray[np.float64]

_FAR = 0.1  # beyond the range, as of speeds outside the training (`emacm.resampling`)


@dataclass(frozen=True)
class FitRange:
    """Lives and columns of the units of a fit.

    Attributes
    ----------
    longest : float
        Longest life, or time under observation.
    lowest, highest : ndarray of shape (n_columns,)
        Range of the health index and of the further columns.
    """

    longest: float
    lowest: Array
    highest: Array

    @classmethod
    def of(cls, histories: list[History], lives: Array) -> FitRange:
        """Return the range of all readings."""
        columns = np.concatenate([unit.columns for unit in histories])
        return cls(float(lives.max()), columns.min(axis=0), columns.max(axis=0))

    def statements(self, units: list[History], n_rows: int, *, margin: float = 0.0) -> list[str]:
        """State for each reading what of it is outside the range; an empty string if nothing is.

        The margin is relative to the longest life and to the width of the range of a column.
        """
        found = [""] * n_rows
        for unit in units:
            for row, age, columns in zip(unit.rows, unit.ages, unit.columns, strict=True):
                found[row] = self._outside(age, columns, margin)
        return found

    def warn_outside(self, units: list[History], n_rows: int, *, stacklevel: int) -> None:
        """Warn of readings far outside the range, naming the first."""
        texts = self.statements(units, n_rows, margin=_FAR)
        rows = [row for row, text in enumerate(texts) if text]
        if rows:
            warnings.warn(
                f"{len(rows)} of {n_rows} readings are far outside the range of the fit, where "
                f"predictions extrapolate; row {rows[0]}: {texts[rows[0]]}",
                UserWarning,
                stacklevel=stacklevel + 1,
            )

    def _outside(self, age: float, columns: Array, margin: float) -> str:
        found = []
        if age > (1 + margin) * self.longest:
            found.append(f"The age {age:g} is above the longest life of the fit, {self.longest:g}.")
        limits = zip(columns, self.lowest, self.highest, strict=True)
        for number, (value, low, high) in enumerate(limits, 1):
            beyond = margin * (high - low)
            if not low - beyond <= value <= high + beyond:
                name = "health index" if number == 1 else f"column {number}"
                found.append(
                    f"The {name} {value:g} is outside that of the fit, {low:g} to {high:g}."
                )
        return " ".join(found) + (" Check the units of measurement." if found else "")


def statement(row: dict[str, Any], coverage: float, *, indexed: bool, outside: str) -> str:
    """Say what an interval is based on.

    Parameters
    ----------
    row : dict
        Its row in the table of `RemainingLife.predict_interval`.
    coverage : float
        Its coverage.
    indexed : bool
        Whether there is a health index.
    outside : str
        What of the reading is outside the range of the fit.
    """
    if row["stage"] == BEFORE_ONSET:
        known = "No damage yet" if indexed else "No health index"
        basis = f"{known}: this is the life of the population at this age."
        when = "of this age"
    else:
        basis = "Damage is present: this follows from the health index of the unit."
        when = "as long after the onset"
    units = f"{row['n_units']} units"
    if not np.isfinite(row["upper"]):
        basis += f" The units do not support an upper limit with {coverage:.0%} coverage."
    elif row["calibration"] != SAME_AGE:
        basis += f" {coverage:.0%} interval as of {units} earlier: too few {when}."
    else:
        basis += f" {coverage:.0%} interval from {units} {when}."
    return f"{basis} {outside}".rstrip()
