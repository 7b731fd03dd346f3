"""Envelopes of bands of frequencies: prewhitening, kurtogram, envelope detection."""
