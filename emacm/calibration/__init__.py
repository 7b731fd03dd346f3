"""Leaving groups out: quantiles and temperatures that hold for new groups."""
