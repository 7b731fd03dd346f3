"""Pipelines of order bins, for the tests of what is done with a model."""

import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm import BinTransformer, OrderPSD, OrderResampler


def log():
    return FunctionTransformer(np.log10, feature_names_out="one-to-one")


def order_bins(*steps, samples=32, revolutions=4, bin_size=1.0, max_order=12, **options):
    """Return a pipeline that computes order bins, and then takes some steps."""
    spectra = OrderResampler(2 * np.pi / samples), OrderPSD(revolutions)
    bins = BinTransformer(bin_size, max_order=max_order)
    return make_pipeline(*spectra, bins, *steps, **options)
