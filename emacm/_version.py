"""Version of the package; part of the keys of stored spectra."""

__version__ = "0.1.0"
