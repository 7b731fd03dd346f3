"""Condition monitoring of electro-mechanical actuators and other rotating machines."""

from emacm.bin_transformer import BinTransformer
from emacm.costs import expected_cost
from emacm.diagnosis import CostSensitiveGaussianBayes, neg_expected_cost
from emacm.order_psd import OrderPSD
from emacm.order_resampler import OrderResampler
from emacm.recordings import Recording

__all__ = [
    "BinTransformer",
    "CostSensitiveGaussianBayes",
    "OrderPSD",
    "OrderResampler",
    "Recording",
    "expected_cost",
    "neg_expected_cost",
]

__version__ = "0.1.0"
