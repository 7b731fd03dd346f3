"""The order spectrum of a recording, as the steps of a fitted model compute it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from sklearn.pipeline import FeatureUnion, Pipeline

from emacm.conditions.router import ConditionRouter
from emacm.decisions.pipelines import search_estimator
from emacm.orders.order_psd import OrderPSD


def order_spectra(model: Any, X: Sequence[Any]) -> pd.DataFrame | None:
    """Return the spectra that a fitted model computes, by its first `OrderPSD`.

    Parameters
    ----------
    model : OrderPSD, Pipeline, FeatureUnion, ConditionRouter or fitted search
        Fitted.
    X : list of Recording
        Of one condition, if the model has several.

    Returns
    -------
    DataFrame of shape (n_recordings, n_columns), or None
        Columns ``channel@order`` [U²/order, or U²]; None if the model computes no order spectra.
    """
    model = search_estimator(model)
    if isinstance(model, OrderPSD):
        return pd.DataFrame(np.asarray(model.transform(X)), columns=model.get_feature_names_out())
    if isinstance(model, ConditionRouter):
        return order_spectra(model.models_of(X)[0], model.inner(X))
    if isinstance(model, FeatureUnion):
        found = (order_spectra(step, X) for _, step in model.transformer_list)
        return next((table for table in found if table is not None), None)
    if not isinstance(model, Pipeline):
        return None
    for _, step in model.steps:
        table = order_spectra(step, X)
        if table is not None:
            return table
        if step in (None, "passthrough") or not hasattr(step, "transform"):
            continue
        X = step.transform(X)
        if hasattr(X, "shape"):  # features
            return None
    return None
