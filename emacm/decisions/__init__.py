"""Decisions: densities of the classes, costs, the decision of least risk, families, metrics."""
