"""Alarms of a monitor: charts of features and of the expected cost, and alarms on the input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any

import numpy as np

from emacm.monitoring.alarms import CUSUM, EWMA
from emacm.monitoring.input_alarms import InputAlarm
from emacm.monitoring.streamed_models import Reading, StreamedModel

_COST = "expected_cost"


class ReadingAlarms:
    """Alarms on the readings of a model.

    Parameters
    ----------
    model : StreamedModel
        The model.
    charts : mapping of str to EWMA or CUSUM, or None
        Fitted charts by the name of a feature, or "expected_cost".

    Attributes
    ----------
    charts : dict of str to str
        By their name, what must agree for their state to be continued.

    Raises
    ------
    TypeError, ValueError
        If a name is unknown, or a chart is not fitted on one column.
    """

    def __init__(self, model: StreamedModel, charts: Mapping[str, EWMA | CUSUM] | None) -> None:
        if not isinstance(charts, Mapping | None):
            raise TypeError(f"alarms must map features to charts, got {charts!r}.")
        self._charts = deepcopy(dict(charts or {}))  # each monitor continues its own
        self.charts: dict[str, str] = {}
        self._features = model.feature_names() if charts else []
        for name, chart in self._charts.items():
            if name not in (_COST, *self._features):
                shown = ", ".join(map(repr, self._features[:8]))
                raise ValueError(
                    f"alarms must name features or {_COST!r}, got {name!r}; the features are "
                    f"{shown}{', ...' if len(self._features) > 8 else ''}."
                )
            if not isinstance(chart, EWMA | CUSUM) or not hasattr(chart, "mean_"):
                raise TypeError(f"alarms[{name!r}] must be a fitted EWMA or CUSUM, got {chart!r}.")
            if chart.n_features_in_ != 1:
                raise ValueError(
                    f"alarms[{name!r}] must be fitted on one column, {name!r}, got a chart of "
                    f"{chart.n_features_in_} columns."
                )
            self.charts[name] = chart.state()["chart"]
        unknown = getattr(model.classifier, "unknown", None)
        self._input = InputAlarm(unknown="unknown" if unknown is None else unknown)

    def update(
        self, reading: Reading, error: str, outside_training: Sequence[str] = ()
    ) -> tuple[str, ...]:
        """Return the alarms of the next reading, in words.

        Parameters
        ----------
        reading : Reading
            The reading; its alarms are statements on what is outside the training.
        error : str
            Why it has no features, or "".
        outside_training : sequence of str
            What is far outside the range of the training.

        Returns
        -------
        tuple of str
        """
        typicality = np.nan if reading.typicality is None else reading.typicality
        row = {"decision": reading.decision, "typicality": typicality, "error": error}
        row["outside_training"] = [*outside_training, *reading.alarms]
        reasons = self._input.reasons(row)
        found = ["; ".join(reasons)] if reasons else []
        for name, chart in self._charts.items():
            value = self._value(reading, name)
            if value is None:
                continue
            if not np.isfinite(value):  # such as the logarithm of a channel without power
                found.append(f"{type(chart).__name__} of {name}: the value is {value}")
                continue
            statistic, alarm = chart.update(np.array([[value]]))
            if alarm.any():
                found.append(f"{type(chart).__name__} of {name}: {float(statistic[0, 0]):.3g}")
        return tuple(found)

    def state(self) -> dict[str, Any]:
        """Return all that `restore` needs."""
        charts = [dict(chart.state()) for chart in self._charts.values()]
        return {"input": self._input.state(), "charts": charts}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state."""
        self._input.restore({name: int(n) for name, n in state["input"].items()})
        for chart, held in zip(self._charts.values(), state["charts"], strict=True):
            chart.restore(held)

    def _value(self, reading: Reading, name: str) -> float | None:
        if reading.features is None or name == _COST:
            return reading.expected_cost
        return float(reading.features[self._features.index(name)])
