"""Condition monitoring of electro-mechanical actuators and other rotating machines."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from emacm._version import __version__

if TYPE_CHECKING:
    from emacm.baseline_normalizer import BaselineNormalizer
    from emacm.bin_transformer import BinTransformer
    from emacm.condition_router import ConditionRouter
    from emacm.costs import expected_cost, group_costs, group_labels
    from emacm.diagnosis import CostSensitiveGaussianBayes, neg_expected_cost
    from emacm.envelope_detector import EnvelopeDetector
    from emacm.evaluation import evaluate
    from emacm.explanations import explain_decision, explain_model, match_fault_orders
    from emacm.machine_parts import BallScrew, Bearing, Gear, Motor
    from emacm.order_cross_spectrum import OrderCrossSpectrum
    from emacm.order_psd import OrderPSD
    from emacm.order_resampler import OrderResampler
    from emacm.posterior_product import PosteriorProduct
    from emacm.predicted_orders import fault_orders, order_bands
    from emacm.recipes import actuator_recipe
    from emacm.recording_statistics import RecordingStatistics
    from emacm.recordings import Recording
    from emacm.relative_harmonics import RelativeHarmonics
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
    "RelativeHarmonics",
    "ShaftHarmonics",
    "StrokeProfile",
    "__version__",
    "actuator_recipe",
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

# Which module has which name. Each is imported when it is first asked for, so that a program waits
# only for what it uses.
_HOME = {
    "BallScrew": "machine_parts",
    "BaselineNormalizer": "baseline_normalizer",
    "Bearing": "machine_parts",
    "BinTransformer": "bin_transformer",
    "ConditionRouter": "condition_router",
    "CostSensitiveGaussianBayes": "diagnosis",
    "EnvelopeDetector": "envelope_detector",
    "Gear": "machine_parts",
    "Motor": "machine_parts",
    "OrderCrossSpectrum": "order_cross_spectrum",
    "OrderPSD": "order_psd",
    "OrderResampler": "order_resampler",
    "PosteriorProduct": "posterior_product",
    "Recording": "recordings",
    "RecordingStatistics": "recording_statistics",
    "RelativeHarmonics": "relative_harmonics",
    "ShaftHarmonics": "shaft_harmonics",
    "StrokeProfile": "stroke_profile",
    "actuator_recipe": "recipes",
    "angle_from_currents": "shaft",
    "angle_from_position": "shaft",
    "angle_from_pulses": "tacho",
    "angle_from_resolver": "shaft",
    "angle_from_tacho": "tacho",
    "angle_from_velocity": "shaft",
    "angle_from_wrapped": "shaft",
    "evaluate": "evaluation",
    "expected_cost": "costs",
    "explain_decision": "explanations",
    "explain_model": "explanations",
    "fault_orders": "predicted_orders",
    "group_costs": "costs",
    "group_labels": "costs",
    "match_fault_orders": "explanations",
    "neg_expected_cost": "diagnosis",
    "order_bands": "predicted_orders",
    "pulse_times": "tacho",
}


def __getattr__(name: str) -> Any:
    """Import a public name at its first use."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"emacm.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return what is public and what was imported."""
    return sorted({*globals(), *__all__})
