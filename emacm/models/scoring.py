"""Decisions on many recordings: one row for each, also for those that cannot be read."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from emacm._progress import run
from emacm.conditions.present_costs import with_present_costs
from emacm.conditions.router import ConditionRouter
from emacm.decisions.pipelines import before_the_last_step, search_estimator
from emacm.decisions.risks import LeastRiskMixin, decide, risks_of
from emacm.explanations.explain import explain_decision
from emacm.files.folder import FileRecording
from emacm.models.model_files import fitted_resamplers
from emacm.models.outside_training import training_statements
from emacm.orders.new_lines import collected_statements
from emacm.recordings.inputs import as_list, received
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from emacm.resampling.quality import Quality, recording_quality

Row = dict[str, Any]


def score(model: Any, recordings: Any, *, n_jobs: int | None = None) -> pd.DataFrame:
    """Decide on recordings, one by one; one that is invalid gives a row with its error.

    Parameters
    ----------
    model : estimator, Pipeline, ConditionRouter or search
        A fitted classifier of recordings.
    recordings : sequence of Recording
        Such as a `RecordingFolder`. Only the recordings that are being processed are in memory.
    n_jobs : int, optional
        Number of recordings processed in parallel.

    Returns
    -------
    DataFrame
        One row for each recording:

        - ``recording``: path of the file, or the number in `recordings`,
        - ``decision``: decision of least expected cost,
        - ``expected_cost`` of this decision, in the unit of the costs,
        - ``typicality``, if the model has it (fitted with ``unknown`` or ``groups``),
        - ``P(<class>)``: posterior probability of each class. If the model has an unknown state,
          they add up to 1 less its probability: all are small beside the decision "unknown",
          although `predict_proba`, which is conditional on the true state being one of the
          classes, may be certain of one of them,
        - ``warnings``: findings of `OrderResampler.quality`,
        - ``outside_training``: properties outside the range of the training recordings, see
          `outside_training`, and what deviates where the decision is the unknown state,
        - ``error``: why there is no decision; empty if there is one.

    Raises
    ------
    TypeError, ValueError
        If `model` is not a fitted classifier, or `recordings` is not a sequence.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import CostSensitiveGaussianBayes, OrderPSD, OrderResampler, Recording, score
    >>> from sklearn.pipeline import make_pipeline
    >>> rng = np.random.default_rng(0)
    >>> runs = [
    ...     Recording({"vibration": level * rng.normal(size=4000)}, 1000, velocity=100.0)
    ...     for level in (1.0, 1.1, 0.9, 3.0, 3.3, 2.7)
    ... ]
    >>> bayes = CostSensitiveGaussianBayes(covariance="diag", shrinkage=0.1)
    >>> model = make_pipeline(OrderResampler(2 * np.pi / 16), OrderPSD(0.25), bayes)
    >>> model = model.fit(runs, ["healthy"] * 3 + ["worn"] * 3)
    >>> table = score(model, [runs[0], runs[4], None])
    >>> table["decision"].tolist()[:2], table["error"][2]
    (['healthy', 'worn'], 'expected a recording, got None.')
    """
    check_model(model)
    columns = score_columns(model)
    if hasattr(recordings, "__len__") and not len(recordings):
        return pd.DataFrame(columns=columns)
    entries = as_list(recordings)
    names = [getattr(entry, "path", number) for number, entry in enumerate(entries)]
    rows = scored_rows(model, [partial(_itself, entry) for entry in entries], names, n_jobs)
    return pd.DataFrame(rows, columns=columns)


def check_model(model: Any) -> list[Any]:
    """Return the classes of a fitted classifier.

    Raises
    ------
    TypeError, ValueError
        If it is not a classifier with `predict_proba`, or not fitted.
    """
    if isinstance(model, type) or not hasattr(model, "fit"):
        raise TypeError(f"model must be a fitted classifier of recordings, got {model!r}.")
    check_is_fitted(model)
    if not hasattr(model, "predict_proba"):
        raise TypeError(
            f"model must be a classifier with posterior probabilities, got {type(model).__name__}."
        )
    return list(model.classes_)


def score_columns(model: Any) -> list[str]:
    """Return the columns of the table of `score` for a fitted model."""
    first = ["recording", "decision", "expected_cost", "typicality"]
    posteriors = [f"P({c})" for c in np.asarray(model.classes_).tolist()]
    return [*first, *posteriors, "warnings", "outside_training", "error"]


def scored_rows(
    model: Any,
    sources: Sequence[Callable[[], Any]],
    names: Sequence[Any],
    n_jobs: int | None = None,
) -> list[Row]:
    """Return the rows of recordings that functions open.

    Parameters
    ----------
    model : estimator
        Fitted classifier.
    sources : sequence of callable
        Each returns a recording, or raises an error, which is written into the row.
    names : sequence
        Name of each recording.
    n_jobs : int, optional
        Number of recordings processed in parallel.

    Returns
    -------
    list of dict
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the rows contain them
        return run(partial(_scored_row, model), sources, names, n_jobs=n_jobs)


def _itself(entry: Any) -> Any:
    return entry


def _scored_row(model: Any, source: Callable[[], Any], name: Any) -> Row:
    """Return the row of one recording, with what is known of it if there is no decision."""
    texts = {"decision": None, "warnings": "", "outside_training": "", "error": ""}
    row = dict.fromkeys(score_columns(model), np.nan) | texts | {"recording": name}
    recording = None
    try:
        recording = source()
        if not isinstance(recording, Recording):
            raise TypeError(f"expected a recording, got {received(recording)}")
        with collected_statements() as new_lines:
            final, table = opened_classifier(model, [recording])
            decided, is_unknown = _decision(model, final, table)
        row |= decided | _findings(model, recording)
        outside = row["outside_training"] or "; ".join(new_lines)
        row["outside_training"] = _reasons(model, recording, outside) if is_unknown else outside
    except Exception as error:  # any error is the result for this recording
        known = isinstance(error, ValueError | TypeError | OSError | ImportError)
        text = str(error) if known else f"{type(error).__name__}: {error}"
        row["error"] = " ".join(text.split()) or type(error).__name__
        with suppress(Exception):  # defects, such as a dead channel, are often the reason
            row |= _findings(model, recording)
    finally:
        if isinstance(recording, FileRecording):
            recording.release()
    return row


def _decision(model: Any, final: Any, table: Any) -> tuple[Row, bool]:
    """Return decision, cost, typicality and probabilities, and whether it decides "unknown"."""
    probabilities, known, row = final.predict_proba(table), final.classes_, Row()
    typicality = None
    if hasattr(final, "typicality"):
        with suppress(ValueError):  # the model has no typicality; the features are valid
            typicality = final.typicality(table)
            row["typicality"] = float(typicality[0])
    if isinstance(final, LeastRiskMixin):
        probabilities, known = final.truth_proba(table, probabilities, typicality), final.truths_
        cost = final.cost_
        row["expected_cost"] = float(risks_of(probabilities, cost)[0].min())
        decision = final.decisions_[decide(probabilities, cost)[0]]
    else:
        decision = final.predict(table)[0]
    of_state = dict(zip(known.tolist(), probabilities[0], strict=True))
    classes = np.asarray(model.classes_).tolist()
    row |= {f"P({label})": float(of_state.get(label, 0.0)) for label in classes}
    row["decision"] = decision.item() if isinstance(decision, np.generic) else decision
    unknown = getattr(final, "unknown", None)
    return row, unknown is not None and bool(row["decision"] == unknown)


def opened_classifier(model: Any, X: list[Any]) -> tuple[Any, Any]:
    """Return the classifier behind routers and pipelines, with its present costs, and its input.

    Parameters
    ----------
    model : estimator
        Fitted classifier.
    X : list of Recording
        Of one condition, if the model has several.

    Returns
    -------
    classifier : estimator
    table : table of shape (n_recordings, n_features)
    """
    final, table = before_the_last_step(model, X)
    if not isinstance(final, ConditionRouter):
        return final, table
    (own,) = final.models_of(table)
    inner, features = opened_classifier(own, table)
    return with_present_costs(inner, own, final.estimator, final.classes_), features


def _reasons(model: Any, recording: Recording, known: str) -> str:
    """Return the sentences on properties outside the training range, then what makes it unknown."""
    statements: list[str] = []
    with suppress(TypeError, ValueError):  # some models decide but cannot be explained
        statements = explain_decision(model, recording).attrs.get("statements", [])
    return "; ".join(filter(None, [known, *statements]))


def _findings(model: Any, recording: Any) -> Row:
    """Return what is unusual about a recording as measured."""
    found = measured_quality(search_estimator(model), recording)
    if found is None:
        return {}
    statements = training_statements(model, recording) or []
    outside = "; ".join(statement.text for statement in statements)
    return {"warnings": found[1].warnings, "outside_training": outside}


def measured_quality(model: Any, recording: Recording) -> tuple[OrderResampler, Quality] | None:
    """Return the first resampler of a fitted model, and the quality of a recording for it.

    Returns
    -------
    (OrderResampler, Quality), or None
        None if the model resamples nothing.
    """
    for part in fitted_resamplers(model)[:1]:
        known = [name for name in part.channels_ if name in recording.channels]
        return part, recording_quality(part.over_angle(recording, known or recording.channels))
    return None
