"""What all displays have in common: axes, colours, legends, labels, and errors."""

import copy
import functools
import sys
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from matplotlib import pyplot
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.text import Text
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LogisticRegression

from emacm import Recording, displays
from emacm.displays import (
    AlarmDisplay,
    ContributionsDisplay,
    DecisionRegionsDisplay,
    DomainDisplay,
    EvaluationDisplay,
    FaultLinesDisplay,
    FeatureDensityDisplay,
    KurtogramDisplay,
    OrderBinsDisplay,
    OrderMapDisplay,
    OrderSpectrumDisplay,
    OrderTrackDisplay,
    OutcomesDisplay,
    RecordingDisplay,
    RemainingLifeDisplay,
    TrendDisplay,
)
from emacm.displays.drawing import COLOURS, mark_orders, tint
from emacm.displays.drawn_values import predicted_lines
from emacm.envelopes.kurtogram import Kurtogram

POINTS = np.array([[0.0, 0.0], [1.0, 2.0]])
BINS = ["a@0-1", "a@1-2"]
RATE = {f"inspection_rate{end}": [0.9] for end in ("", "_low", "_high")}
REMAINING = {"age": [0.0, 9.0], "stage": ["before onset", "damage"], "median": [50.0, 11.0]}
TRACK = {"channel": "a", "order": 1, "time": [1.0], "speed": [9.0], "amplitude": 2.0, "phase": 1.0}
TREND = {"unit": "A", "time": [1, 2], "index": [0.9, 3.1], "limit": 1.5, "alarm": [False, True]}
ONE_OF_EACH = [
    AlarmDisplay([3.0, 4.0, 8.0], [0.5, 6.0, 5.5], 5.0),
    ContributionsDisplay(BINS, [1.0, -1.0]),
    DecisionRegionsDisplay([0, 1], [0, 2], [[0, 1], [0, 1]], ["a", "b"], POINTS, ["a", "b"]),
    DomainDisplay(pd.DataFrame({"state": ["a"], "slowest": [10.0], "fastest": [20.0]})),
    EvaluationDisplay(
        pd.DataFrame(RATE, index=["by run"]),
        pd.DataFrame([[3, 0], [1, 2]], index=["a", "b"], columns=["a", "b"]),
    ),
    FaultLinesDisplay(np.arange(100) / 10, np.ones(100), {"BPFO": 2.5}),
    FeatureDensityDisplay(["a"], [[0, 0]], [np.eye(2)], POINTS, ["a", "a"]),
    KurtogramDisplay(Kurtogram((9.0,), (np.array([9.0, 18.0]),), (np.array([0.2, 3.0]),))),
    OrderBinsDisplay(BINS, {"a": [1.0, 2.0]}),
    OrderMapDisplay([0, 1, 2], np.ones((2, 3)), [[0, 1], [1, 2]], [1.0, 2.0]),
    OrderSpectrumDisplay([0, 1, 2], {"a": [1.0, 2.0, 3.0]}),
    OrderTrackDisplay(pd.DataFrame(TRACK)),
    OutcomesDisplay(pd.DataFrame({"correct": [1]}, index=["all"])),
    RecordingDisplay(Recording({"a": [1.0, 2.0]}, 10, velocity=[1.0, 1.0])),
    RemainingLifeDisplay(
        pd.DataFrame(REMAINING | {"lower": [5.0, 7.0], "upper": [np.inf, 19.0]}), true=[20.0, 11.0]
    ),
    TrendDisplay(pd.DataFrame(TREND)),
]
NAMED = OutcomesDisplay | EvaluationDisplay  # what is drawn has names
each = pytest.mark.parametrize("display", ONE_OF_EACH, ids=lambda d: type(d).__name__)


def axes_for(display):
    two = RecordingDisplay | EvaluationDisplay | OrderTrackDisplay
    n_panels = 2 if isinstance(display, two) else 1
    return Figure(layout="constrained").subplots(n_panels, squeeze=False)[:, 0]


@functools.cache
def drawn(display):
    """Draw a copy of a display, once for all tests that only look at it; return it and its axes."""
    axes, display = axes_for(display), copy.copy(display)
    assert display.plot(ax=axes[0] if len(axes) == 1 else axes) is display
    return display, axes


@each
def test_a_display_labels_both_axes(display):
    display, axes = drawn(display)
    assert axes[-1].get_xlabel()
    named = isinstance(display, NAMED)
    assert axes[0].get_ylabel() or named


@each
def test_a_new_figure_fits_a_page_and_its_text_is_readable(display):
    display.plot()
    assert display.figure_.get_figwidth() == 6.3  # 16 cm
    sizes = [text.get_fontsize() for text in display.figure_.findobj(Text) if text.get_text()]
    assert min(sizes) >= 8
    pyplot.close(display.figure_)


STATES = ["broken", "new", "aged"]  # the healthy one, "new", is neither first nor last


def states_displays():
    bins = OrderBinsDisplay(BINS, {name: [1.0, 2.0] for name in STATES}, healthy="new")
    spectrum = OrderSpectrumDisplay([0, 1, 2], {name: [1, 2, 3] for name in STATES}, healthy="new")
    at = [[0, 1], [3, 5], [7, 2]]
    densities = FeatureDensityDisplay(STATES, at, [np.eye(2)] * 3, at, STATES, healthy="new")
    regions = DecisionRegionsDisplay(
        [0, 3, 7], [1, 5], [[0, 1, 2]] * 2, STATES, at, STATES, healthy="new"
    )
    return [bins, spectrum, densities, regions]


@pytest.mark.parametrize("display", states_displays(), ids=lambda d: type(d).__name__)
def test_healthy_has_its_colour_and_the_first_place_of_the_legend(display):
    ax = Figure().subplots()
    display.plot(ax=ax)
    legend = ax.get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["new", "broken", "aged"]
    first = legend.legend_handles[0]
    colour = first.get_color() if hasattr(first, "get_color") else first.get_facecolor()
    if isinstance(display, DecisionRegionsDisplay):
        assert to_hex(colour).upper() == tint(COLOURS[0], 0.22).upper()
    else:
        assert to_hex(colour).upper() == COLOURS[0]
    others = {line.get_color() for line in ax.lines if not isinstance(line.get_color(), tuple)}
    assert COLOURS[0] in others or isinstance(display, DecisionRegionsDisplay)


def test_all_displays_are_public():
    tested = {type(display).__name__ for display in ONE_OF_EACH}
    assert tested == {name for name in displays.__all__ if name.endswith("Display")}


def test_names_of_fault_orders_do_not_cover_each_other():
    ax = Figure(figsize=(6, 3)).subplots()
    ax.set_xlim(0, 50)
    mark_orders(ax, predicted_lines({f"a long name {i}": 6 + 0.1 * i for i in range(5)}, 0.02))
    ax.figure.draw_without_rendering()
    # The extent of an annotation holds its pointer too; that of a text does not.
    boxes = sorted((Text.get_window_extent(text) for text in ax.texts), key=lambda box: box.x0)
    assert len(boxes) == 5
    assert all(one.x1 <= other.x0 for one, other in pairwise(boxes))


@pytest.mark.slow
def test_without_matplotlib_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match=r"emacm\[plot\]"):
        ONE_OF_EACH[0].plot()


SPECTRA = pd.DataFrame(np.ones((2, 4)), columns=["a@0", "a@1", "b@0", "b@2"])
RUN = Recording({"a": np.ones(400)}, 100, velocity=np.ones(400))
FINE = np.arange(100) / 10


@pytest.mark.parametrize(
    ("make", "place"),
    [
        (lambda: OrderBinsDisplay(BINS, {"a": [1.0, -2.0]}), r"powers of 'a'.*\[1\]"),
        (lambda: OrderBinsDisplay.from_table(np.ones((2, 3))), "order axis"),
        (lambda: OrderSpectrumDisplay([0, 1, 2], {"a": [1.0, np.nan, 3.0]}), r"'a'.* 1\]"),
        (lambda: OrderSpectrumDisplay.from_table(SPECTRA), "different orders"),
        (lambda: OrderSpectrumDisplay.from_estimator(LogisticRegression(), []), "OrderPSD"),
        (lambda: OrderMapDisplay.from_recording(RUN, revolutions=500), "of 500 revolutions"),
        (lambda: RecordingDisplay.from_recording(RUN, ax=Figure().subplots()), "2 panels"),
        (lambda: ContributionsDisplay(BINS, [1.0]), "contributions"),
        (lambda: FeatureDensityDisplay.from_estimator(LogisticRegression(), POINTS, [0, 1]), "fit"),
        (lambda: OutcomesDisplay.from_predictions(["worn"], ["dry"], healthy="new"), "'new'"),
        (lambda: FaultLinesDisplay(FINE, np.ones(100), {"mesh": 30.0}), "mesh"),
    ],
)
def test_what_cannot_be_drawn_is_refused_with_its_place(make, place):
    with pytest.raises((TypeError, ValueError, NotFittedError), match=place):
        make()
