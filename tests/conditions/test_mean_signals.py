"""Facts about time-synchronous averages on a grid of shaft angles."""

import numpy as np

from emacm.conditions.signal_baseline import AngleBaseline, GridSignals, mean_sections


def test_a_mean_is_known_where_half_of_the_recordings_have_been():
    ones = [[GridSignals(0, np.ones((1, 4)))], [GridSignals(2, np.ones((1, 4)) * 3)]]
    third = [GridSignals(2, np.ones((1, 2)) * 5), GridSignals(2, np.ones((1, 2)) * 7)]
    (mean,) = mean_sections([*ones, third])
    assert (mean.first, mean.signals.tolist()) == (2, [[4.0, 4.0]])


def test_places_apart_make_sections_of_their_own():
    parts = mean_sections([[GridSignals(5, np.ones((2, 2))), GridSignals(-3, np.zeros((2, 3)))]])
    assert [(part.first, part.stop) for part in parts] == [(-3, 0), (5, 7)]


def test_no_strokes_have_no_mean():
    assert mean_sections([]) == ()


def test_a_baseline_says_where_it_is_known():
    sections = {1: (GridSignals(2, np.ones((1, 3))),), -1: (GridSignals(-4, np.ones((1, 3))),)}
    baseline = AngleBaseline(0.5, "angle", sections, "load=20")
    assert baseline.reach(1) == ((1.0, 2.0),)
    assert baseline.reach(-1) == ((2.0, 1.0),)
    assert baseline.reach(0) == ()
    assert repr(baseline).startswith("AngleBaseline(load=20; ")
