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

from emacm.displays._drawing import COLOURS, HATCHES, MARKERS, STYLES
from emacm.displays.bins import OrderBinsDisplay
from emacm.displays.components import ExplainedVarianceDisplay, LoadingsDisplay
from emacm.displays.contributions import ContributionsDisplay
from emacm.displays.densities import FeatureDensityDisplay
from emacm.displays.evaluation import EvaluationDisplay
from emacm.displays.order_map import OrderMapDisplay
from emacm.displays.outcomes import OutcomesDisplay
from emacm.displays.recording import RecordingDisplay
from emacm.displays.regions import DecisionRegionsDisplay
from emacm.displays.spectrum import OrderSpectrumDisplay

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
