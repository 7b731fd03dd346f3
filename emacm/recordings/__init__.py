"""Time-domain measurements: recordings, what their meta states, envelopes."""
