"""Displays: each holds computed values, draws them, and returns them as a table.

- `RecordingDisplay`: signals and shaft speed of a recording over time.
- `OrderSpectrumDisplay`: order spectra by group of recordings; `OrderMapDisplay`: order spectra of
  one recording over time or speed; `OrderBinsDisplay`: order bins by group.
- `ExplainedVarianceDisplay`, `LoadingsDisplay`: principal components.
- `FeatureDensityDisplay`, `DecisionRegionsDisplay`: classes and decisions in a plane.
- `OutcomesDisplay`: correct decisions, false alarms, inspections, wrong faults and missed
  detections by signal and condition.
- `EvaluationDisplay`: random split and splits by run, unit and condition; `ComparisonDisplay`:
  several evaluations; `ReliabilityDisplay`: calibration of posterior probabilities.
- `TypicalityDisplay`: typicality over the posterior probability, of known and unknown states;
  `UnknownRocDisplay`: how well families left out of training are recognised as unknown.
- `FaultLinesDisplay`: order spectrum of the envelope, its background and the predicted lines;
  `KurtogramDisplay`: spectral kurtosis by band.
- `AlarmDisplay`: statistic of an alarm over time; `RemainingLifeDisplay`: remaining life over age.
- `TrendDisplay`: health index of each unit over time, with limit and alarms.
- `ContributionsDisplay`: contribution of each order to a decision, and predicted fault orders.

A display is made by one of its ``from_`` methods, or from values and ``plot()``. `ax_` and
`figure_` hold its axes and figure; ``frame()`` returns its values. A display with several panels
takes one Axes for each. New figures are 16 cm wide, so that text is readable on a page; legends
stand above the axes. The healthy state has the same colour in every display, and is first in
legends.
"""

from emacm.displays._drawing import COLOURS, HATCHES, MARKERS, STYLES
from emacm.displays.alarm_chart import AlarmDisplay
from emacm.displays.bins import OrderBinsDisplay
from emacm.displays.comparison import ComparisonDisplay
from emacm.displays.components import ExplainedVarianceDisplay, LoadingsDisplay
from emacm.displays.contributions import ContributionsDisplay
from emacm.displays.densities import FeatureDensityDisplay
from emacm.displays.evaluation import EvaluationDisplay
from emacm.displays.fault_lines import FaultLinesDisplay
from emacm.displays.kurtogram import KurtogramDisplay
from emacm.displays.order_map import OrderMapDisplay
from emacm.displays.outcomes import OutcomesDisplay
from emacm.displays.recording import RecordingDisplay
from emacm.displays.regions import DecisionRegionsDisplay
from emacm.displays.reliability import ReliabilityDisplay
from emacm.displays.remaining_life import RemainingLifeDisplay
from emacm.displays.spectrum import OrderSpectrumDisplay
from emacm.displays.trend import TrendDisplay
from emacm.displays.typicality import TypicalityDisplay
from emacm.displays.unknown_roc import UnknownRocDisplay

__all__ = [
    "COLOURS",
    "HATCHES",
    "MARKERS",
    "STYLES",
    "AlarmDisplay",
    "ComparisonDisplay",
    "ContributionsDisplay",
    "DecisionRegionsDisplay",
    "EvaluationDisplay",
    "ExplainedVarianceDisplay",
    "FaultLinesDisplay",
    "FeatureDensityDisplay",
    "KurtogramDisplay",
    "LoadingsDisplay",
    "OrderBinsDisplay",
    "OrderMapDisplay",
    "OrderSpectrumDisplay",
    "OutcomesDisplay",
    "RecordingDisplay",
    "ReliabilityDisplay",
    "RemainingLifeDisplay",
    "TrendDisplay",
    "TypicalityDisplay",
    "UnknownRocDisplay",
]
