"""Resampling from time to shaft angle (computed order tracking)."""
