"""Decisions on maintenance from the remaining life: continue, order a part, stop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._checks import check_number

Array = NDArray[np.float64]

CONTINUE, ORDER, STOP = "continue", "order", "stop"


@dataclass(frozen=True, kw_only=True)
class MaintenanceCosts:
    """Costs of late and early decisions, in one unit of money, and times in the unit of the ages.

    Parameters
    ----------
    failure : float
        Cost of a failure in operation, beyond that of a planned replacement.
    waiting : float
        Cost per time of standing still without a part.
    early : float
        Cost per time of remaining life that is given up by a replacement.
    holding : float
        Cost per time of a part that lies in stock.
    lead_time : float
        Time from the order to the arrival of a part.
    review : float
        Time until the next decision.

    Raises
    ------
    TypeError, ValueError
        If a cost or a time is negative, or `review` is 0.

    Examples
    --------
    >>> costs = MaintenanceCosts(
    ...     failure=5000, waiting=100, early=2, holding=1, lead_time=72, review=24
    ... )
    >>> costs.lead_time
    72
    """

    failure: float
    waiting: float
    early: float
    holding: float
    lead_time: float
    review: float

    def __post_init__(self) -> None:
        for name in ("failure", "waiting", "early", "holding", "lead_time"):
            check_number(getattr(self, name), name, at_least=0)
        check_number(self.review, "review", above=0)


def expected_costs(lives: Array, costs: MaintenanceCosts) -> pd.DataFrame:
    """Return the expected cost of each decision.

    Parameters
    ----------
    lives : ndarray of shape (n_readings, n_draws)
        Equally probable remaining lives of each reading.
    costs : MaintenanceCosts
        Costs and times.

    Returns
    -------
    DataFrame
        Columns "continue", "order", "stop" and "decision", the one of least cost.

    Notes
    -----
    With the remaining life R, lead time L and time to the next review H:

    - stop now, order, and replace when the part arrives: waiting L + early E[R];
    - order and continue: failure P(R <= H) + waiting E[(L - R)+] + holding E[(R - L)+];
    - continue, and order at the next review at the earliest: failure P(R <= H) +
      waiting E[(H + L - R)+] + holding E[(R - H - L)+], and if R <= H the part is ordered at
      the failure: waiting L.

    Examples
    --------
    >>> costs = MaintenanceCosts(
    ...     failure=5000, waiting=100, early=2, holding=1, lead_time=72, review=24
    ... )
    >>> expected_costs(np.array([[20.0], [80.0], [5000.0]]), costs)["decision"].tolist()
    ['stop', 'order', 'continue']
    """
    lead, review = costs.lead_time, costs.review
    until_later = np.where(lives <= review, lead, np.maximum(review + lead - lives, 0))
    fails = costs.failure * np.mean(lives <= review, axis=1)
    stop = costs.waiting * lead + costs.early * lives.mean(axis=1)
    stock, missing = np.maximum(lives - lead, 0), np.maximum(lead - lives, 0)
    order = fails + np.mean(costs.waiting * missing + costs.holding * stock, axis=1)
    stock = np.maximum(lives - review - lead, 0)
    later = fails + np.mean(costs.waiting * until_later + costs.holding * stock, axis=1)
    table = pd.DataFrame({CONTINUE: later, ORDER: order, STOP: stop})
    table["decision"] = table.idxmin(axis=1)
    return table
