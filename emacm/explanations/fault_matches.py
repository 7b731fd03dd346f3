"""Comparison of an explanation with the predicted fault orders of the machine."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from emacm._checks import check_number
from emacm.machine.fault_orders import named_orders, slip_ranges


def match_fault_orders(
    explanation: pd.DataFrame,
    orders: pd.DataFrame | Mapping[str, float],
    *,
    slip: float = 0.02,
    min_width: float = 0.0,
) -> pd.DataFrame:
    """Assign predicted fault orders to the bins that determine a decision or a model.

    Parameters
    ----------
    explanation : DataFrame
        From `explain_decision` or `explain_model`, or some of its rows (those of one channel, for
        example).
    orders : DataFrame from `fault_orders`, or mapping of str to float
        Predicted orders by name, with their harmonics.
    slip : float
        Largest relative deviation of a line with slip from its order; in a mapping, every
        line may slip.
    min_width : float
        Smallest width of a line [orders], for example ``4 / revolutions``.

    Returns
    -------
    DataFrame
        The explanation with the columns "fault" (the predicted order in the bin, or the one
        nearest to its centre if there are several; "none" without any), "fault_order" (NaN if
        none) and "n_faults" (number of predicted orders in the bin, which it cannot separate).
        `attrs` additionally contains "predicted_share", the fraction of the contributions in bins
        with a fault order, and "predicted_bins", the fraction of the bins with one, which is the
        predicted share of a model that depends on all bins equally.

    Raises
    ------
    TypeError, ValueError
        If `explanation` is not an explanation, there is no order, or an order is not positive.

    See Also
    --------
    emacm.fault_orders : The orders of the parts.
    emacm.explain_decision : Bins that decided.

    Notes
    -----
    A predicted share close to the fraction of bins proves nothing; one below it suggests a model
    that recognises the units instead of the fault. With many harmonics and wide bins, every bin
    contains a fault order.

    Examples
    --------
    >>> from emacm import fault_orders, match_fault_orders
    >>> explanation = pd.DataFrame(
    ...     {"column": ["v@12-13", "v@6-7"], "low": [12, 6], "high": [13, 7], "share": [0.3, 0.7]}
    ... )
    >>> matched = match_fault_orders(explanation, fault_orders({"BPFI": 6.123}, harmonics=2))
    >>> matched["fault"].tolist(), matched.attrs["predicted_share"]
    (['2xBPFI', 'BPFI'], 1.0)
    """
    columns = ("column", "low", "high", "share")
    missing = [c for c in columns if c not in getattr(explanation, "columns", ())]
    if missing:
        raise ValueError(
            f"explanation must be a table from explain_decision or explain_model; it has no "
            f"column {missing[0]!r}."
        )
    check_number(slip, "slip", at_least=0, below=1)
    _, centres = named_orders(orders)
    names, low, high = slip_ranges(orders, slip=slip, min_width=min_width)
    bottom, top = (
        explanation[name].to_numpy(np.float64)[:, np.newaxis] for name in ("low", "high")
    )
    inside = (low <= top) & (high >= bottom)
    for row, column in enumerate(explanation["column"]):
        if np.isnan(bottom[row, 0]):  # a named band without known edges
            inside[row] = np.array(names) == str(column).rpartition("@")[2]
    distance = np.where(np.isnan(bottom), 0.0, np.abs(centres - (bottom + top) / 2))
    nearest = np.argmin(np.where(inside, distance, np.inf), axis=1)
    hit = np.any(inside, axis=1)
    matched = explanation.assign(
        fault=np.where(hit, np.array(names, dtype=object)[nearest], "none"),
        fault_order=np.where(hit, centres[nearest], np.nan),
        n_faults=inside.sum(axis=1),
    )
    total = float(explanation["share"].sum())
    matched.attrs = {
        **explanation.attrs,
        "predicted_share": float(explanation["share"][hit].sum()) / total if total else 0.0,
        "predicted_bins": float(hit.mean()) if len(hit) else 0.0,
    }
    return matched
