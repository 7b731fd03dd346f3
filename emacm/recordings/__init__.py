"""Time-domain measurements: recordings, and what their meta states."""
