"""Pictures: each holds computed numbers, draws them, and gives them as a table.

- `RecordingDisplay`: the signals and the shaft speed of a recording, over time.
- `OrderSpectrumDisplay`: order spectra by group; `OrderMapDisplay`: of one recording, over
  time or speed; `OrderBinsDisplay`: gathered into bins.
- `ExplainedVarianceDisplay`, `LoadingsDisplay`: what principal components are made of.
- `FeatureDensityDisplay`, `DecisionRegionsDisplay`: classes and decisions in a plane.
- `OutcomesDisplay`: how often decisions were right, by signal and condition.
- `EvaluationDisplay`: what a random split and splits by run, unit and condition say.
- `ContributionsDisplay`: which orders carried a decision, beside those of known faults.

A picture is made by one of its ``from_`` methods, or from numbers and ``plot()``. What it drew
on is in its `ax_` and `figure_`; ``frame()`` gives its numbers. A picture of several panels
takes as many axes.
"""

from emacm._drawing import COLOURS, HATCHES, MARKERS, STYLES
from emacm.bin_displays import OrderBinsDisplay
from emacm.component_displays import ExplainedVarianceDisplay, LoadingsDisplay
from emacm.contribution_displays import ContributionsDisplay
from emacm.decision_displays import DecisionRegionsDisplay
from emacm.evaluation_displays import EvaluationDisplay
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
    "EvaluationDisplay",
    "ExplainedVarianceDisplay",
    "FeatureDensityDisplay",
    "LoadingsDisplay",
    "OrderBinsDisplay",
    "OrderMapDisplay",
    "OrderSpectrumDisplay",
    "OutcomesDisplay",
    "RecordingDisplay",
]
