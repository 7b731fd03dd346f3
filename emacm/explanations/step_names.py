"""Names of the columns that steps make, also behind logarithms that state none."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.pipeline import FeatureUnion, Pipeline
from sklearn.preprocessing import FunctionTransformer


def is_skipped(step: Any) -> bool:
    """Return whether a step of a pipeline does nothing."""
    return step is None or isinstance(step, str)


def names_of(maker: Any) -> NDArray[Any]:
    """Return the names of the columns that a step makes.

    Raises
    ------
    ValueError
        If they have no names; the message states the remedy.
    """
    try:
        return maker.get_feature_names_out()
    except AttributeError as error:
        names = _names_without_logarithms(maker)
        if names is not None:
            return np.array(names, dtype=object)
        raise ValueError(
            f"the columns of {type(maker).__name__} have no names, which an explanation needs: "
            f"{error} In that step, write FunctionTransformer(np.log10, "
            f"feature_names_out='one-to-one')."
        ) from error


def _names_without_logarithms(maker: Any) -> list[Any] | None:
    """Return the names of columns after element-wise functions that state none; None if unknown.

    A `FunctionTransformer` has no names unless they are requested. If its function treats each
    column by itself, as a logarithm does, the names before it hold.
    """
    if isinstance(maker, FeatureUnion):
        names: list[Any] = []
        for prefix, step in maker.transformer_list:
            block = [] if step == "drop" else _names_without_logarithms(step)
            if block is None:
                return None
            verbose = maker.verbose_feature_names_out
            names += [f"{prefix}__{name}" for name in block] if verbose else block
        return names
    if isinstance(maker, Pipeline):
        for _, step in reversed(maker.steps):
            if is_skipped(step):
                continue
            if not (isinstance(step, FunctionTransformer) and _is_elementwise(step)):
                return _names_without_logarithms(step)
    try:
        return list(maker.get_feature_names_out())
    except AttributeError:
        return None


def _is_elementwise(step: FunctionTransformer) -> bool:
    """Return whether the function of a table is that of each of its columns, tested with one."""
    table = np.random.default_rng(0).uniform(0.5, 2.0, (3, 4))
    arguments = step.kw_args or {}
    if step.func is None:
        return True
    try:
        whole = step.func(table, **arguments)
        columns = [step.func(table[:, [k]], **arguments) for k in range(table.shape[1])]
        return np.array_equal(whole, np.hstack(columns))
    except (TypeError, ValueError, AttributeError):  # a function of DataFrames, for example
        return False
