"""The models that can be applied to a stream, and what they state of a spectrum."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_is_fitted

from emacm.alarms.control_charts import CUSUM, EWMA
from emacm.alarms.input_alarms import InputAlarm
from emacm.decisions.pipelines import search_estimator
from emacm.decisions.risks import LeastRiskMixin
from emacm.orders.bin_transformer import collected_statements
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.digests import model_digest
from emacm.resampling.order_resampler import OrderResampler
from emacm.resampling.quality import Quality
from emacm.resampling.training_range import outside_range
from emacm.streams.packed_state import Resumable

Array = NDArray[np.floating]
_COST = "expected_cost"


class ReadingAlarms(Resumable):
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

    held = ("_input", "_charts")

    def __init__(self, model: StreamedModel, charts: Mapping[str, EWMA | CUSUM] | None) -> None:
        if not isinstance(charts, Mapping | None):
            raise TypeError(f"alarms must map features to charts, got {charts!r}.")
        charts = charts or {}
        self._charts = deepcopy(list(charts.values()))  # each monitor continues its own
        self.charts: dict[str, str] = {}
        self._features = model.feature_names() if charts else []
        for name, chart in charts.items():
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

    def update(self, reading: Reading) -> tuple[str, ...]:
        """Return the alarms of the next reading, in words.

        Parameters
        ----------
        reading : Reading
            The reading.

        Returns
        -------
        tuple of str
        """
        names = ("decision", "typicality", "error")
        row: dict[str, Any] = {name: getattr(reading, name) for name in names}
        reasons = self._input.reasons(row | {"outside_training": reading.defects})
        found = ["; ".join(reasons)] if reasons else []
        values: dict[str, Any] = {_COST: reading.expected_cost}
        if reading.features is not None:
            values |= dict(zip(self._features, reading.features, strict=False))
        for name, chart in zip(self.charts, self._charts, strict=True):
            value = values.get(name)
            if value is None:
                continue
            if not np.isfinite(value):  # such as the logarithm of a channel without power
                found.append(f"{type(chart).__name__} of {name}: the value is {value}")
                continue
            statistic, alarm = chart.update(np.array([[value]]))
            if alarm.any():
                found.append(f"{type(chart).__name__} of {name}: {float(statistic[0, 0]):.3g}")
        return tuple(found)


_CHAIN = "OrderResampler, OrderPSD, transformers of tables (BinTransformer, FaultLines, ...)"


@dataclass(frozen=True)
class Reading:
    """What a monitor states of one interval of a stream.

    Attributes
    ----------
    start, time : float
        Start of the interval, and its end, at which the reading is complete [s].
    features : ndarray of shape (n_features,), or None
        Input of the classifier. None if the interval holds no segment of Welch's method.
    posterior : dict of label to float
        Probability of each class, and of the unknown state if the classifier has one (they add up
        to 1); empty without features or classifier.
    decision : label or None
        Decision of the classifier.
    risk : dict of label to float
        Conditional risk of each decision; empty for a classifier without costs.
    typicality : float or None
        Typicality of the features, if the classifier states it.
    alarms : tuple of str
        Alarms, in words; empty if there is none.
    outside_training : tuple of str
        What of the interval is outside the range of the training recordings, in sentences, as
        `emacm.outside_training` states it of the finished recording: speeds, revolutions, sampling
        rates, and levels.
    complete : bool
        False for the reading of an unfinished interval: it has no alarms, states no new spectral
        lines, and is no reading of the charts.
    defects : tuple of str
        Defects of channels that those of the training do not have, what is far outside the
        training, and new spectral lines. Each is an alarm.
    fastest : float
        Highest speed of the shaft of interest [rad/s]; NaN if it did not turn.
    error : str
        Why there are no features; empty if there are.
    """

    start: float
    time: float
    features: Array | None = field(repr=False)
    posterior: dict[Any, float]
    decision: Any
    risk: dict[Any, float]
    typicality: float | None
    alarms: tuple[str, ...] = ()
    outside_training: tuple[str, ...] = ()
    complete: bool = True
    defects: tuple[str, ...] = ()
    fastest: float = np.nan
    error: str = ""

    @property
    def expected_cost(self) -> float | None:
        """Conditional risk of the decision."""
        return self.risk.get(self.decision)


class StreamedModel:
    """A fitted pipeline, taken apart into what is done sample by sample and what is done after.

    Parameters
    ----------
    model : estimator
        Fitted pipeline, or a search over one.

    Attributes
    ----------
    resampler : OrderResampler
        Its first step.
    psd : OrderPSD
        Its second step.
    classifier : estimator or None
        Its last step, if that is a classifier.

    Raises
    ------
    TypeError, ValueError
        If it is not such a pipeline, or has a step or an option that needs a whole recording.
    """

    def __init__(self, model: Any) -> None:
        model = search_estimator(model)
        if not isinstance(model, Pipeline):
            raise TypeError(
                f"model must be a fitted pipeline of {_CHAIN} and a classifier, got "
                f"{type(model).__name__}."
            )
        check_is_fitted(model)
        steps = _flattened(model)
        first, second = [*steps, None, None][:2]
        if not isinstance(first, OrderResampler):
            raise ValueError(_refusal(first, "OrderResampler", "first"))
        if not isinstance(second, OrderPSD):
            raise ValueError(_refusal(second, "OrderPSD", "second"))
        self.resampler, self.psd = first, second
        self._check_options()
        self.classifier = steps.pop() if hasattr(steps[-1], "predict_proba") else None
        self._transformers = steps[2:]

    def reading(
        self, start: float, time: float, powers: Array, quality: Quality, complete: bool = True
    ) -> Reading:
        """Return what the model states of the spectra of an interval.

        Parameters
        ----------
        start, time : float
            The interval [s].
        powers : ndarray of shape (n_channels, [n_directions,] n_orders)
            As `SegmentPlan.spectra_of` returns them.
        quality : Quality
            Properties of the interval.
        complete : bool
            Whether the interval is finished; if not, there are no defects and no new lines.

        Returns
        -------
        Reading
        """
        table: Any = self.psd.table_of([powers])
        with collected_statements() as new_lines:
            for transformer in self._transformers:
                table = transformer.transform(table)
        outside = outside_range(quality, self.resampler.training_range_, {})
        texts = tuple(statement.text for statement in outside)
        lines = tuple(new_lines[0]) if complete else ()
        usual = self.resampler.training_findings_
        defects = [found.text for found in quality.findings if found.kind not in usual]
        defects += [statement.text for statement in outside if statement.severe]
        reading = Reading(
            *(start, time, np.asarray(table)[0], {}, None, {}, None, (), texts, complete),
            defects=tuple(defects) if complete else (),
            fastest=quality.row["fastest"],
        )
        final = self.classifier
        if final is None:
            return reading
        probabilities, states = final.predict_proba(table), final.classes_
        if isinstance(final, LeastRiskMixin):
            probabilities, states = final.truth_proba(table, probabilities), final.truths_
        typicality, risk = None, {}
        if hasattr(final, "typicality"):
            with suppress(ValueError):  # the model has no typicality
                typicality = float(final.typicality(table)[0])
        if hasattr(final, "risk"):
            risk = _labelled(final.decisions_, final.risk(table)[0])
        (decision,) = np.asarray(final.predict(table)).tolist()
        return replace(
            reading,
            posterior=_labelled(states, probabilities[0]),
            decision=decision,
            risk=risk,
            typicality=typicality,
            defects=(*reading.defects, *lines),
            outside_training=texts or lines,
        )

    def digest(self) -> str:
        """Return the digest of the parameters and the fitted values of all steps."""
        return model_digest([self.resampler, self.psd, *self._transformers, self.classifier])

    def feature_names(self) -> list[str]:
        """Return the names of the features."""
        names = self.psd.get_feature_names_out()
        for transformer in self._transformers:
            names = transformer.get_feature_names_out(names)
        return list(names)

    def _check_options(self) -> None:
        resampler, psd = self.resampler, self.psd
        if not hasattr(psd, "theta_s_") or psd.theta_s_ is None:
            raise ValueError("OrderPSD was fitted on plain rows; a stream needs recordings.")
        refused = {
            "antialias=False of OrderResampler": not resampler.antialias,
            "direction='travel' of OrderResampler": resampler.direction == "travel",
            "average='median' of OrderPSD, which needs all segments": psd.average == "median",
            "short='pad' of OrderPSD, which needs whole strokes": psd.short == "pad",
        }
        for option, present in refused.items():
            if present:
                raise ValueError(f"a stream cannot be processed with {option}. Change the model.")


def _flattened(model: Pipeline) -> list[Any]:
    """Return the steps of nested pipelines, without those that pass their input through."""
    steps: list[Any] = []
    for _, step in model.steps:
        if isinstance(step, Pipeline):
            steps += _flattened(step)
        elif step is not None and step != "passthrough":
            steps.append(step)
    return steps


def _refusal(step: Any, wanted: str, place: str) -> str:
    return (
        f"the {place} step of the model must be {wanted}, got {type(step).__name__}, which needs "
        f"whole recordings. A stream is processed by {_CHAIN} and a classifier; apply other models "
        f"to finished recordings with score."
    )


def _labelled(labels: Any, values: Any) -> dict[Any, float]:
    return dict(zip(np.asarray(labels).tolist(), map(float, values), strict=True))
