"""Public names of emacm; each is imported from its module when it is first used (SPEC 1)."""

from ._statements import EmacmWarning as EmacmWarning
from ._statements import Statement as Statement
from ._version import __version__ as __version__
from .conditions.feature_baseline import FeatureBaseline as FeatureBaseline
from .conditions.router import ConditionRouter as ConditionRouter
from .conditions.signal_baseline import SignalBaseline as SignalBaseline
from .decisions.classifier import CostSensitiveGaussianBayes as CostSensitiveGaussianBayes
from .decisions.families import as_families as as_families
from .decisions.families import family_costs as family_costs
from .decisions.families import set_costs as set_costs
from .decisions.least_risk import LeastRiskClassifier as LeastRiskClassifier
from .decisions.metrics import expected_cost as expected_cost
from .decisions.metrics import neg_expected_cost as neg_expected_cost
from .decisions.new_units import NewUnitClassifier as NewUnitClassifier
from .decisions.posterior_product import PosteriorProduct as PosteriorProduct
from .envelopes.envelope_detector import EnvelopeDetector as EnvelopeDetector
from .envelopes.kurtogram import kurtogram as kurtogram
from .envelopes.kurtogram import spectral_kurtosis as spectral_kurtosis
from .envelopes.prewhitening import CepstralPrewhitening as CepstralPrewhitening
from .evaluation.comparison import compare as compare
from .evaluation.evaluate import evaluate as evaluate
from .evaluation.miss_rate import miss_rate_limit as miss_rate_limit
from .evaluation.novelty import evaluate_unknown as evaluate_unknown
from .explanations.explain import explain_decision as explain_decision
from .explanations.explain import explain_model as explain_model
from .explanations.explain import match_fault_orders as match_fault_orders
from .export.c_files import export_c as export_c
from .files.folder import RecordingFolder as RecordingFolder
from .files.folder import open_recording as open_recording
from .files.layout import Layout as Layout
from .machine.bearing_recipe import bearing_recipe as bearing_recipe
from .machine.fault_lines import FaultLines as FaultLines
from .machine.fault_orders import fault_orders as fault_orders
from .machine.fault_orders import order_bands as order_bands
from .machine.find_faults import find_faults as find_faults
from .machine.gears import Gear as Gear
from .machine.gears import PlanetaryGear as PlanetaryGear
from .machine.motors import InductionMotor as InductionMotor
from .machine.motors import Motor as Motor
from .machine.rolling import BallScrew as BallScrew
from .machine.rolling import Bearing as Bearing
from .models.baselines import add_baseline as add_baseline
from .models.model_files import load_model as load_model
from .models.model_files import save_model as save_model
from .models.recipes import actuator_recipe as actuator_recipe
from .models.recipes import spectrum_recipe as spectrum_recipe
from .models.scoring import outside_training as outside_training
from .models.scoring import score as score
from .orders.band_powers import BandPowers as BandPowers
from .orders.bin_transformer import BinTransformer as BinTransformer
from .orders.order_cross_spectrum import OrderCrossSpectrum as OrderCrossSpectrum
from .orders.order_psd import OrderPSD as OrderPSD
from .orders.order_track import order_components as order_components
from .orders.order_track import order_track as order_track
from .recordings.recording import Recording as Recording
from .reports.maintenance import maintenance_report as maintenance_report
from .reports.model_cards import describe_model as describe_model
from .resampling.order_resampler import OrderResampler as OrderResampler
from .shaft.angle import angle_from_currents as angle_from_currents
from .shaft.angle import angle_from_position as angle_from_position
from .shaft.angle import angle_from_resolver as angle_from_resolver
from .shaft.angle import angle_from_velocity as angle_from_velocity
from .shaft.angle import angle_from_wrapped as angle_from_wrapped
from .shaft.tacho import angle_from_pulses as angle_from_pulses
from .shaft.tacho import angle_from_tacho as angle_from_tacho
from .shaft.tacho import pulse_times as pulse_times
from .shaft.vibration import angle_from_vibration as angle_from_vibration
from .streams.order_monitor import OrderMonitor as OrderMonitor
from .stroke_features.gears import GearIndicators as GearIndicators
from .stroke_features.gears import SynchronousAverage as SynchronousAverage
from .stroke_features.harmonics import ShaftHarmonics as ShaftHarmonics
from .stroke_features.profile import StrokeProfile as StrokeProfile
from .stroke_features.statistics import RecordingStatistics as RecordingStatistics

__all__ = [
    "BallScrew",
    "BandPowers",
    "Bearing",
    "BinTransformer",
    "CepstralPrewhitening",
    "ConditionRouter",
    "CostSensitiveGaussianBayes",
    "EmacmWarning",
    "EnvelopeDetector",
    "FaultLines",
    "FeatureBaseline",
    "Gear",
    "GearIndicators",
    "InductionMotor",
    "Layout",
    "LeastRiskClassifier",
    "Motor",
    "NewUnitClassifier",
    "OrderCrossSpectrum",
    "OrderMonitor",
    "OrderPSD",
    "OrderResampler",
    "PlanetaryGear",
    "PosteriorProduct",
    "Recording",
    "RecordingFolder",
    "RecordingStatistics",
    "ShaftHarmonics",
    "SignalBaseline",
    "Statement",
    "StrokeProfile",
    "SynchronousAverage",
    "__version__",
    "actuator_recipe",
    "add_baseline",
    "angle_from_currents",
    "angle_from_position",
    "angle_from_pulses",
    "angle_from_resolver",
    "angle_from_tacho",
    "angle_from_velocity",
    "angle_from_vibration",
    "angle_from_wrapped",
    "as_families",
    "bearing_recipe",
    "compare",
    "describe_model",
    "evaluate",
    "evaluate_unknown",
    "expected_cost",
    "explain_decision",
    "explain_model",
    "export_c",
    "family_costs",
    "fault_orders",
    "find_faults",
    "kurtogram",
    "load_model",
    "maintenance_report",
    "match_fault_orders",
    "miss_rate_limit",
    "neg_expected_cost",
    "open_recording",
    "order_bands",
    "outside_training",
    "pulse_times",
    "save_model",
    "score",
    "set_costs",
    "spectral_kurtosis",
    "spectrum_recipe",
]
