"""Maintenance reports: one page for each decision, in words, as HTML."""
