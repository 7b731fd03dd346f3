"""Version of the package; part of the keys of stored spectra."""

__version__ = "1.0.0rc1"
