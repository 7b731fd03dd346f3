"""Condition monitoring of electro-mechanical actuators and other rotating machines."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from emacm._version import __version__ as __version__

if TYPE_CHECKING:
    from emacm.conditions.feature_baseline import (
        FeatureBaseline as FeatureBaseline,
    )
    from emacm.conditions.router import (
        ConditionRouter as ConditionRouter,
    )
    from emacm.conditions.signal_baseline import (
        SignalBaseline as SignalBaseline,
    )
    from emacm.conditions.units import (
        for_unit as for_unit,
    )
    from emacm.conditions.units import (
        prediction_sets as prediction_sets,
    )
    from emacm.decisions.classifier import (
        CostSensitiveGaussianBayes as CostSensitiveGaussianBayes,
    )
    from emacm.decisions.families import (
        as_families as as_families,
    )
    from emacm.decisions.families import (
        family_costs as family_costs,
    )
    from emacm.decisions.least_risk import (
        LeastRiskClassifier as LeastRiskClassifier,
    )
    from emacm.decisions.metrics import (
        expected_cost as expected_cost,
    )
    from emacm.decisions.metrics import (
        neg_expected_cost as neg_expected_cost,
    )
    from emacm.decisions.new_units import (
        NewUnitClassifier as NewUnitClassifier,
    )
    from emacm.decisions.posterior_product import (
        PosteriorProduct as PosteriorProduct,
    )
    from emacm.evaluation.comparison import (
        compare as compare,
    )
    from emacm.evaluation.evaluate import (
        evaluate as evaluate,
    )
    from emacm.evaluation.miss_rate import (
        miss_rate_limit as miss_rate_limit,
    )
    from emacm.explanations.explain import (
        explain_decision as explain_decision,
    )
    from emacm.explanations.explain import (
        explain_model as explain_model,
    )
    from emacm.explanations.fault_matches import (
        match_fault_orders as match_fault_orders,
    )
    from emacm.machine.fault_lines import (
        FaultLines as FaultLines,
    )
    from emacm.machine.fault_orders import (
        fault_orders as fault_orders,
    )
    from emacm.machine.fault_orders import (
        order_bands as order_bands,
    )
    from emacm.machine.gears import (
        Gear as Gear,
    )
    from emacm.machine.gears import (
        PlanetaryGear as PlanetaryGear,
    )
    from emacm.machine.motors import (
        InductionMotor as InductionMotor,
    )
    from emacm.machine.motors import (
        Motor as Motor,
    )
    from emacm.machine.rolling import (
        BallScrew as BallScrew,
    )
    from emacm.machine.rolling import (
        Bearing as Bearing,
    )
    from emacm.models.actuator_recipe import (
        actuator_recipe as actuator_recipe,
    )
    from emacm.models.bearing_recipe import (
        bearing_recipe as bearing_recipe,
    )
    from emacm.models.find_faults import (
        find_faults as find_faults,
    )
    from emacm.models.model_files import (
        describe_model as describe_model,
    )
    from emacm.models.model_files import (
        load_model as load_model,
    )
    from emacm.models.model_files import (
        save_model as save_model,
    )
    from emacm.models.outside_training import (
        outside_training as outside_training,
    )
    from emacm.models.scoring import (
        score as score,
    )
    from emacm.monitoring.order_monitor import OrderMonitor as OrderMonitor
    from emacm.orders.bin_transformer import (
        BinTransformer as BinTransformer,
    )
    from emacm.orders.order_cross_spectrum import (
        OrderCrossSpectrum as OrderCrossSpectrum,
    )
    from emacm.orders.order_psd import (
        OrderPSD as OrderPSD,
    )
    from emacm.recordings.bearing_datasets import (
        open_bearing_dataset as open_bearing_dataset,
    )
    from emacm.recordings.envelope_detector import (
        EnvelopeDetector as EnvelopeDetector,
    )
    from emacm.recordings.files import (
        RecordingFolder as RecordingFolder,
    )
    from emacm.recordings.files import (
        open_recording as open_recording,
    )
    from emacm.recordings.kurtogram import (
        kurtogram as kurtogram,
    )
    from emacm.recordings.kurtogram import (
        spectral_kurtosis as spectral_kurtosis,
    )
    from emacm.recordings.layout import (
        Layout as Layout,
    )
    from emacm.recordings.prewhitening import (
        CepstralPrewhitening as CepstralPrewhitening,
    )
    from emacm.recordings.recording import (
        Recording as Recording,
    )
    from emacm.reports.maintenance import (
        maintenance_report as maintenance_report,
    )
    from emacm.resampling.order_resampler import (
        OrderResampler as OrderResampler,
    )
    from emacm.resampling.signal_cache import (
        SignalCache as SignalCache,
    )
    from emacm.shaft.angle import (
        angle_from_currents as angle_from_currents,
    )
    from emacm.shaft.angle import (
        angle_from_position as angle_from_position,
    )
    from emacm.shaft.angle import (
        angle_from_resolver as angle_from_resolver,
    )
    from emacm.shaft.angle import (
        angle_from_velocity as angle_from_velocity,
    )
    from emacm.shaft.angle import (
        angle_from_wrapped as angle_from_wrapped,
    )
    from emacm.shaft.tacho import (
        angle_from_pulses as angle_from_pulses,
    )
    from emacm.shaft.tacho import (
        angle_from_tacho as angle_from_tacho,
    )
    from emacm.shaft.tacho import (
        pulse_times as pulse_times,
    )
    from emacm.shaft.vibration import (
        angle_from_vibration as angle_from_vibration,
    )
    from emacm.stroke_features.gears import (
        GearIndicators as GearIndicators,
    )
    from emacm.stroke_features.gears import (
        SynchronousAverage as SynchronousAverage,
    )
    from emacm.stroke_features.harmonics import (
        ShaftHarmonics as ShaftHarmonics,
    )
    from emacm.stroke_features.profile import (
        StrokeProfile as StrokeProfile,
    )
    from emacm.stroke_features.statistics import (
        RecordingStatistics as RecordingStatistics,
    )

# Each public name is imported from its module when it is first used, so that a program loads only
# what it needs. Type checkers read the block above instead; a test keeps the two equal.
_PUBLIC = {
    "recordings.recording": [
        "Recording",
    ],
    "recordings.files": [
        "RecordingFolder",
        "open_recording",
    ],
    "recordings.bearing_datasets": [
        "open_bearing_dataset",
    ],
    "recordings.layout": [
        "Layout",
    ],
    "recordings.envelope_detector": [
        "EnvelopeDetector",
    ],
    "shaft.angle": [
        "angle_from_currents",
        "angle_from_position",
        "angle_from_resolver",
        "angle_from_velocity",
        "angle_from_wrapped",
    ],
    "shaft.tacho": [
        "angle_from_pulses",
        "angle_from_tacho",
        "pulse_times",
    ],
    "shaft.vibration": [
        "angle_from_vibration",
    ],
    "resampling.order_resampler": [
        "OrderResampler",
    ],
    "resampling.signal_cache": [
        "SignalCache",
    ],
    "orders.order_psd": [
        "OrderPSD",
    ],
    "orders.order_cross_spectrum": [
        "OrderCrossSpectrum",
    ],
    "orders.bin_transformer": [
        "BinTransformer",
    ],
    "stroke_features.statistics": [
        "RecordingStatistics",
    ],
    "stroke_features.profile": [
        "StrokeProfile",
    ],
    "stroke_features.harmonics": [
        "ShaftHarmonics",
    ],
    "stroke_features.gears": [
        "GearIndicators",
        "SynchronousAverage",
    ],
    "conditions.signal_baseline": [
        "SignalBaseline",
    ],
    "conditions.feature_baseline": [
        "FeatureBaseline",
    ],
    "conditions.router": [
        "ConditionRouter",
    ],
    "conditions.units": [
        "for_unit",
        "prediction_sets",
    ],
    "machine.rolling": [
        "BallScrew",
        "Bearing",
    ],
    "machine.gears": [
        "Gear",
        "PlanetaryGear",
    ],
    "machine.motors": [
        "InductionMotor",
        "Motor",
    ],
    "machine.fault_lines": [
        "FaultLines",
    ],
    "machine.fault_orders": [
        "fault_orders",
        "order_bands",
    ],
    "decisions.classifier": [
        "CostSensitiveGaussianBayes",
    ],
    "decisions.families": [
        "as_families",
        "family_costs",
    ],
    "decisions.least_risk": [
        "LeastRiskClassifier",
    ],
    "decisions.metrics": [
        "expected_cost",
        "neg_expected_cost",
    ],
    "decisions.new_units": [
        "NewUnitClassifier",
    ],
    "decisions.posterior_product": [
        "PosteriorProduct",
    ],
    "evaluation.comparison": [
        "compare",
    ],
    "evaluation.evaluate": [
        "evaluate",
    ],
    "evaluation.miss_rate": [
        "miss_rate_limit",
    ],
    "explanations.explain": [
        "explain_decision",
        "explain_model",
    ],
    "explanations.fault_matches": [
        "match_fault_orders",
    ],
    "models.actuator_recipe": [
        "actuator_recipe",
    ],
    "models.model_files": [
        "describe_model",
        "load_model",
        "save_model",
    ],
    "models.outside_training": [
        "outside_training",
    ],
    "models.scoring": [
        "score",
    ],
    "recordings.prewhitening": [
        "CepstralPrewhitening",
    ],
    "models.bearing_recipe": [
        "bearing_recipe",
    ],
    "models.find_faults": [
        "find_faults",
    ],
    "monitoring.order_monitor": [
        "OrderMonitor",
    ],
    "reports.maintenance": [
        "maintenance_report",
    ],
    "recordings.kurtogram": [
        "spectral_kurtosis",
        "kurtogram",
    ],
}
_HOME = {name: module for module, names in _PUBLIC.items() for name in names}

__all__ = ["__version__", *_HOME]


def __getattr__(name: str) -> Any:
    """Import a public name at its first use."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"emacm.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names and what has been imported."""
    return sorted({*globals(), *__all__})
