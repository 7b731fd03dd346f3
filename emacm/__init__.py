"""Condition monitoring of electro-mechanical actuators and other rotating machines."""

from emacm._version import __version__
from emacm.baseline_normalizer import BaselineNormalizer
from emacm.bin_transformer import BinTransformer
from emacm.condition_router import ConditionRouter
from emacm.costs import expected_cost, group_costs, group_labels
from emacm.diagnosis import CostSensitiveGaussianBayes, neg_expected_cost
from emacm.envelope_detector import EnvelopeDetector
from emacm.evaluation import evaluate
from emacm.explanations import explain_decision, explain_model, match_fault_orders
from emacm.fault_orders import fault_orders, order_bands
from emacm.machine_parts import BallScrew, Bearing, Gear, Motor
from emacm.order_cross_spectrum import OrderCrossSpectrum
from emacm.order_psd import OrderPSD
from emacm.order_resampler import OrderResampler
from emacm.posterior_product import PosteriorProduct
from emacm.recording_statistics import RecordingStatistics
from emacm.recordings import Recording
from emacm.shaft import (
    angle_from_currents,
    angle_from_position,
    angle_from_resolver,
    angle_from_velocity,
    angle_from_wrapped,
)
from emacm.shaft_harmonics import ShaftHarmonics
from emacm.stroke_profile import StrokeProfile
from emacm.tacho import angle_from_pulses, angle_from_tacho, pulse_times

__all__ = [
    "BallScrew",
    "BaselineNormalizer",
    "Bearing",
    "BinTransformer",
    "ConditionRouter",
    "CostSensitiveGaussianBayes",
    "EnvelopeDetector",
    "Gear",
    "Motor",
    "OrderCrossSpectrum",
    "OrderPSD",
    "OrderResampler",
    "PosteriorProduct",
    "Recording",
    "RecordingStatistics",
    "ShaftHarmonics",
    "StrokeProfile",
    "__version__",
    "angle_from_currents",
    "angle_from_position",
    "angle_from_pulses",
    "angle_from_resolver",
    "angle_from_tacho",
    "angle_from_velocity",
    "angle_from_wrapped",
    "evaluate",
    "expected_cost",
    "explain_decision",
    "explain_model",
    "fault_orders",
    "group_costs",
    "group_labels",
    "match_fault_orders",
    "neg_expected_cost",
    "order_bands",
    "pulse_times",
]
