"""Decisions: densities of the classes, costs, the decision of least risk, families and metrics.

- `cost_table`: read any form of stating costs.
- `conditional_risk`, `least_risk`: expected cost of each decision, and the decision with the
  least, from posterior probabilities of any classifier.
- `canonical_cost`: the part of a cost matrix that determines decisions.
"""

from emacm.decisions.costs import cost_table
from emacm.decisions.risks import canonical_cost, conditional_risk, least_risk

__all__ = ["canonical_cost", "conditional_risk", "cost_table", "least_risk"]
