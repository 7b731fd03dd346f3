"""Defects that were found in use, one test for each, so that they do not come back."""

# Estimators

# Channels and the shaft

# Files

# Scores and pages

# Monitors
