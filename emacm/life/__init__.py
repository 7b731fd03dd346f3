"""Remaining life of units, maintenance decisions from it, and its metrics."""
