"""How far the columns of one recording are from the recordings of a class, such as healthy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.explanations.deviations import find_deviations, power_scales
from emacm.explanations.feature_traces import FeatureTrace, trace_features
from emacm.explanations.opened_pipelines import OpenedPipeline, one_recording
from emacm.explanations.unknown_statements import PROJECTED

Array = NDArray[np.float64]


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
        deviations" for other features), the same in "sigmas" (standard deviations within the
        class), "level" of the recording and "reference_level" of the class [dB; NaN for other
        features]. NaN for columns that a selection has dropped.

    Raises
    ------
    TypeError, ValueError
        As `explain_decision`; or if `reference` is not a class, or the features are projections and
        there is no `background`.

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
    values, bins = opened.table(x)
    trace = trace_features(opened.steps, values)
    if background is None:
        mean, spread = _learned(opened.classifier, trace, reference)
    else:
        others = trace.positions(opened.table(background)[0])
        mean, spread = others.mean(axis=0), others.std(axis=0)
    row, unknown = values[0], np.full(len(mean), np.nan)
    found, sigmas = (
        find_deviations(trace, row, scales, (mean, unknown, unknown), spread)
        for scales in (power_scales(opened.maker, len(row)), np.full(len(row), np.nan))
    )
    return bins.assign(
        deviation=found.of_mean,
        unit=np.where(found.in_decibels, "dB", "standard deviations"),
        sigmas=sigmas.of_mean,
        level=found.levels,
        reference_level=found.mean_levels,
    )


def _learned(
    classifier: CostSensitiveGaussianBayes, trace: FeatureTrace, reference: Any
) -> tuple[Array, Array]:
    """Return mean and standard deviations of the positions of a class, as learned."""
    classes = classifier.classes_.tolist()
    if reference not in classes:
        raise ValueError(f"reference must be one of the classes {classes}, got {reference!r}.")
    if trace.linear:
        raise ValueError(f"{PROJECTED}.")
    code = classes.index(reference)
    covariances = np.asarray(classifier.covariances_)
    if classifier.covariance == "tied":
        variances = np.diag(covariances)
    else:
        variances = covariances[code] if covariances.ndim == 2 else np.diag(covariances[code])
    return classifier.means_[code], np.sqrt(variances)
