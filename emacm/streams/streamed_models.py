"""The models that can be applied to a stream, and what they state of a spectrum."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_is_fitted

from emacm._saved import Resumable
from emacm._statements import Statement
from emacm.decisions.pipelines import check_unknown_states, parts_with_input, search_estimator
from emacm.explanations.deviations import second_state_statement
from emacm.explanations.opened_pipelines import flat_steps
from emacm.findings.quality import Quality
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.digests import model_digest
from emacm.resampling.order_resampler import OrderResampler

Array = NDArray[np.floating]


class ReadingAlarms(Resumable):
    """Alarms on readings that a model cannot judge.

    Parameters
    ----------
    unknown : label
        Decision that is an alarm.
    """

    held = ("_n_untypical",)

    def __init__(self, unknown: Any) -> None:
        self._unknown, self._n_untypical = unknown, 0

    def update(self, reading: Reading) -> tuple[str, ...]:
        """Return the alarms of the next reading, in words."""
        found = [*filter(None, [reading.error]), *(defect.text for defect in reading.defects)]
        if reading.decision == self._unknown:
            found.append("unknown state")
        # As few as one in a hundred of the training are; that two in succession are is no chance.
        is_untypical = reading.typicality is not None and reading.typicality <= 0.01
        self._n_untypical = self._n_untypical + 1 if is_untypical else 0
        if self._n_untypical >= 2:
            found.append(f"{self._n_untypical} successive untypical readings")
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
        Probability of each class, given that one of them is true, as of `predict_proba`; empty
        without features or classifier.
    unknown_proba : float or None
        Probability of the unknown state, if the classifier has one.
    decision : label or None
        Decision of the classifier.
    risk : dict of label to float
        Conditional risk of each decision; empty for a classifier without costs.
    typicality : float or None
        Typicality of the features, if the classifier states it.
    alarms : tuple of str
        Alarms, in words; empty if there is none.
    outside_training : tuple of Statement
        What of the interval is outside the range of the training recordings, as
        `emacm.outside_training` states it of the finished recording: speeds, revolutions, sampling
        rates, and levels.
    complete : bool
        False for the reading of an unfinished interval: it has no alarms, and states no new
        spectral lines.
    defects : tuple of Statement
        Defects of channels that those of the training do not have, what is far outside the
        training, and new spectral lines. Each is an alarm.
    fastest : float
        Highest speed of the shaft of interest [rad/s]; NaN if it did not turn.
    error : str
        Why there are no features; empty if there are.
    """

    start: float
    time: float
    features: Array | None = field(default=None, repr=False)
    posterior: dict[Any, float] = field(default_factory=dict)
    unknown_proba: float | None = None
    decision: Any = None
    risk: dict[Any, float] = field(default_factory=dict)
    typicality: float | None = None
    alarms: tuple[str, ...] = ()
    outside_training: tuple[Statement, ...] = ()
    complete: bool = True
    defects: tuple[Statement, ...] = ()
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
                f"model must be a pipeline of {_CHAIN} and classifier, got {type(model).__name__}."
            )
        check_is_fitted(model)
        check_unknown_states(model)
        steps = [step for _, step in flat_steps(model)]
        self.resampler, self.psd = [*steps, None, None][:2]
        for place, step, kind in (
            ("first", self.resampler, OrderResampler),
            ("second", self.psd, OrderPSD),
        ):
            if not isinstance(step, kind):
                raise ValueError(
                    f"the {place} step of the model must be {kind.__name__}, got "
                    f"{type(step).__name__}, which needs whole recordings. A stream is processed "
                    f"by {_CHAIN} and a classifier; apply other models to recordings with score."
                )
        self._check_options()
        self.classifier = steps.pop() if hasattr(steps[-1], "predict_proba") else None
        self.transformers = steps[2:]
        self._names = getattr([*self.transformers, self.classifier][0], "feature_names_in_", None)

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
        if self._names is not None:  # of a model that was fitted to a DataFrame
            table = pd.DataFrame(table, columns=self._names)
        lines: list[Statement] = []
        for step in [*self.transformers, *filter(None, [self.classifier])]:
            if complete:
                for part, own in parts_with_input(step, table, BinTransformer):
                    lines += part.new_lines(own)[0]
            if step is not self.classifier:
                table = step.transform(table)
        known = self.resampler.training_range_
        outside = known.outside(quality, {})
        defects = known.unusual(quality) + [stated for stated in outside if stated.severe] + lines
        decided, beside = self._decided(table), list[Statement]()
        if second_states := getattr(self.classifier, "second_states", None):
            (second,) = second_states(table, [decided["decision"]])
            if second is not None:
                text = second_state_statement(decided["decision"], second)
                beside = [Statement("second state", "", text)]
        return Reading(
            start,
            time,
            np.asarray(table)[0],
            **decided,
            outside_training=(*(outside or lines), *beside),
            complete=complete,
            defects=tuple(defects) if complete else (),
            fastest=quality.row["fastest"],
        )

    def _decided(self, table: Any) -> dict[str, Any]:
        """Return the fields of a reading that the classifier states."""
        final = self.classifier
        if final is None:
            return {}
        posterior = _labelled(final.classes_, final.predict_proba(table)[0])
        found: dict[str, Any] = {"posterior": posterior}
        if getattr(final, "unknown", None) is not None:
            found["unknown_proba"] = float(final.unknown_proba(table)[0])
        (found["decision"],) = np.asarray(final.predict(table)).tolist()
        if hasattr(final, "risk"):
            found["risk"] = _labelled(final.decisions_, final.risk(table)[0])
        if hasattr(final, "typicality"):
            with suppress(ValueError):  # the model has no typicality
                found["typicality"] = float(final.typicality(table)[0])
        return found

    def digest(self) -> str:
        """Return the digest of the parameters and the fitted values of all steps."""
        return model_digest([self.resampler, self.psd, *self.transformers, self.classifier])

    def _check_options(self) -> None:
        resampler, psd = self.resampler, self.psd
        refused = {
            "antialias=False of OrderResampler": not resampler.antialias,
            "direction='travel' of OrderResampler": resampler.direction == "travel",
            "average='median' of OrderPSD, which needs all segments": psd.average == "median",
            "short='pad' of OrderPSD, which needs whole strokes": psd.short == "pad",
        }
        for option, present in refused.items():
            if present:
                raise ValueError(f"a stream cannot be processed with {option}. Change the model.")


def _labelled(labels: Any, values: Any) -> dict[Any, float]:
    return dict(zip(np.asarray(labels).tolist(), map(float, values), strict=True))
