"""Densities, costs, risks, families of states and metrics: from features to a decision."""
