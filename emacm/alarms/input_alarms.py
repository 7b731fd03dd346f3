"""Alarms on what a model cannot judge: unknown states and implausible input."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd

from emacm._checks import check_count, check_number

COLUMNS = ("decision", "typicality", "warnings", "outside_training", "error")
_TEXTS = ("error", "warnings", "outside_training")


class InputAlarm:
    """Alarm on readings that are unlike the training data, or that are no valid measurement.

    A model decides between the states it knows. This alarm states when there is no basis for its
    decisions: an unknown state was decided, several successive readings are untypical, or a
    reading has warnings or an error. It takes the table of `score` or rows with these columns.

    Parameters
    ----------
    typicality : float, default=0.01
        Typicality at or below which a reading is untypical. Of healthy readings this fraction is.
    consecutive : int, default=2
        Successive untypical readings that give an alarm.
    unknown : label, default="unknown"
        Label of the unknown state.

    Raises
    ------
    TypeError, ValueError
        If a parameter is invalid.

    See Also
    --------
    emacm.score : Its columns are those that this alarm reads.

    Examples
    --------
    >>> readings = pd.DataFrame(
    ...     {"decision": ["healthy", "healthy", "unknown"], "typicality": [0.004, 0.008, 0.2],
    ...      "warnings": ["", "current: constant", ""]}
    ... )
    >>> alarms = InputAlarm().update(readings)
    >>> [alarm for alarm in alarms["alarm"]]
    ['', 'warnings: current: constant; 2 successive untypical readings', 'unknown state']
    >>> round(InputAlarm().arl())
    10100
    """

    def __init__(
        self, typicality: float = 0.01, *, consecutive: int = 2, unknown: Any = "unknown"
    ) -> None:
        self.typicality = check_number(typicality, "typicality", above=0, below=1)
        self.consecutive = check_count(consecutive, "consecutive")
        self.unknown = unknown
        self.n_untypical_ = 0

    def arl(self) -> float:
        """Return the nominal number of healthy readings until an alarm on typicality.

        Returns
        -------
        float
            For independent readings: the mean waiting time for a run of successes, W. Feller, An
            Introduction to Probability Theory, vol. 1, section XIII.7.
        """
        p, length = self.typicality, self.consecutive
        return (1 - p**length) / ((1 - p) * p**length)

    def update(self, readings: pd.DataFrame) -> pd.DataFrame:
        """Continue with one or several readings.

        Parameters
        ----------
        readings : DataFrame
            One row per reading with any of the columns "decision", "typicality", "warnings",
            "outside_training" and "error". A missing typicality (NaN) is not untypical.

        Returns
        -------
        DataFrame
            "alarm": the reasons, separated by semicolons, or "" for no alarm; with the index of
            `readings`.

        Raises
        ------
        TypeError, ValueError
            If `readings` is not such a table.
        """
        if not isinstance(readings, pd.DataFrame):
            raise TypeError(f"readings must be a DataFrame, got {type(readings).__name__}.")
        if not set(COLUMNS) & set(readings.columns):
            raise ValueError(
                f"readings must have at least one of the columns {list(COLUMNS)}, got "
                f"{list(readings.columns)}. Pass the table that score returns."
            )
        reasons = [self.reasons(row) for row in readings.to_dict("records")]
        return pd.DataFrame({"alarm": ["; ".join(found) for found in reasons]}, readings.index)

    def reasons(self, row: Mapping[Any, Any]) -> list[str]:
        """Continue with one reading, and return the reasons for an alarm.

        Parameters
        ----------
        row : mapping
            Any of the columns of `update` with their values.

        Returns
        -------
        list of str
            Empty for no alarm.
        """
        found = []
        for name in _TEXTS:
            text = row.get(name, "")
            text = "; ".join(map(str, text)) if isinstance(text, list | tuple) else text
            if isinstance(text, str) and text:
                found.append(f"{name.replace('_', ' ')}: {text}")
        if row.get("decision") == self.unknown:
            found.append("unknown state")
        typicality = row.get("typicality")
        if typicality is None:
            typicality = np.nan
        elif not isinstance(typicality, Real):
            raise TypeError(f"typicality must be a number, got {typicality!r}. Convert the column.")
        self.n_untypical_ = self.n_untypical_ + 1 if typicality <= self.typicality else 0
        if self.n_untypical_ >= self.consecutive:
            found.append(f"{self.n_untypical_} successive untypical readings")
        return found

    def state(self) -> dict[str, int]:
        """Return what `restore` needs to continue.

        Returns
        -------
        dict
            Number of successive untypical readings.
        """
        return {"n_untypical": self.n_untypical_}

    def restore(self, state: dict[str, int]) -> InputAlarm:
        """Continue from a state.

        Parameters
        ----------
        state : dict
            Result of `state`.

        Returns
        -------
        InputAlarm
            Itself.
        """
        self.n_untypical_ = check_count(state["n_untypical"], "n_untypical", at_least=0)
        return self
