"""Order spectra, the order axis of a table, order bins, cached spectra."""
