"""Displays: each holds computed values, draws them, and returns them as a table.

- `RecordingDisplay`: signals and shaft speed of a recording over time.
- `OrderSpectrumDisplay`: order spectra by group of recordings; `OrderMapDisplay`: order spectra of
  one recording over time or speed; `OrderBinsDisplay`: order bins by group.
- `OrderTrackDisplay`: amplitude and phase of orders over speed or time, or as a polar plot.
- `FeatureDensityDisplay`, `DecisionRegionsDisplay`: classes and decisions in a plane.
- `OutcomesDisplay`: correct decisions, false alarms, inspections, wrong faults and missed
  detections by signal and condition.
- `EvaluationDisplay`: random split and splits by run, unit and condition, confusion matrix, and
  reliability of the posterior probabilities.
- `DomainDisplay`: speeds and conditions of training recordings.
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

from emacm.displays.bars import ContributionsDisplay as ContributionsDisplay
from emacm.displays.bearings import FaultLinesDisplay as FaultLinesDisplay
from emacm.displays.bearings import KurtogramDisplay as KurtogramDisplay
from emacm.displays.domain import DomainDisplay as DomainDisplay
from emacm.displays.evaluation import EvaluationDisplay as EvaluationDisplay
from emacm.displays.evaluation import OutcomesDisplay as OutcomesDisplay
from emacm.displays.monitoring import AlarmDisplay as AlarmDisplay
from emacm.displays.monitoring import RemainingLifeDisplay as RemainingLifeDisplay
from emacm.displays.monitoring import TrendDisplay as TrendDisplay
from emacm.displays.order_tracks import OrderTrackDisplay as OrderTrackDisplay
from emacm.displays.planes import DecisionRegionsDisplay as DecisionRegionsDisplay
from emacm.displays.planes import FeatureDensityDisplay as FeatureDensityDisplay
from emacm.displays.power import OrderBinsDisplay as OrderBinsDisplay
from emacm.displays.power import OrderSpectrumDisplay as OrderSpectrumDisplay
from emacm.displays.recording import OrderMapDisplay as OrderMapDisplay
from emacm.displays.recording import RecordingDisplay as RecordingDisplay

__all__ = sorted(name for name in globals() if name.endswith("Display"))
