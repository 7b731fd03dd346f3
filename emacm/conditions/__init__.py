"""Signals and features that also depend on load, speed and unit: baselines and routing."""
