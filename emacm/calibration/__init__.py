"""Leaving groups out: quantiles, tails and temperatures that hold for new groups."""
