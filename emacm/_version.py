"""Version of the package; kept spectra are told apart by it."""

__version__ = "0.1.0"
