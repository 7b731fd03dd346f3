"""Pictures: each holds computed numbers, draws them, and gives them as a table."""

from emacm._drawing import COLOURS, HATCHES, MARKERS, STYLES
from emacm.bin_displays import OrderBinsDisplay
from emacm.component_displays import ExplainedVarianceDisplay, LoadingsDisplay
from emacm.contribution_displays import ContributionsDisplay
from emacm.decision_displays import DecisionRegionsDisplay
from emacm.feature_displays import FeatureDensityDisplay
from emacm.order_map_displays import OrderMapDisplay
from emacm.outcome_displays import OutcomesDisplay
from emacm.signal_displays import RecordingDisplay
from emacm.spectrum_displays import OrderSpectrumDisplay

__all__ = [
    "COLOURS",
    "HATCHES",
    "MARKERS",
    "STYLES",
    "ContributionsDisplay",
    "DecisionRegionsDisplay",
    "ExplainedVarianceDisplay",
    "FeatureDensityDisplay",
    "LoadingsDisplay",
    "OrderBinsDisplay",
    "OrderMapDisplay",
    "OrderSpectrumDisplay",
    "OutcomesDisplay",
    "RecordingDisplay",
]
