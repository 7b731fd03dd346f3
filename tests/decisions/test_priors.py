"""Facts about the forms in which priors are given, and their checks."""

import re

import numpy as np
import pandas as pd
import pytest

from emacm.decisions.costs import class_priors

CLASSES, COUNTS = np.array(["dry", "new", "worn"]), np.array([1.0, 6.0, 3.0])


@pytest.mark.parametrize(
    ("priors", "expected"),
    [
        (None, [0.1, 0.6, 0.3]),
        ("uniform", [1 / 3] * 3),
        ([0, 1, 0], [0, 1, 0]),
        ((0.2, 0.3, 0.5), [0.2, 0.3, 0.5]),
        (pd.Series({"worn": 0.5, "dry": 0.2, "new": 0.3}), [0.2, 0.3, 0.5]),
        ([0.2, 0.3, 0.5 + 9e-7], np.array([0.2, 0.3, 0.5 + 9e-7]) / (1 + 9e-7)),
    ],
)
def test_every_form_gives_probabilities_in_the_order_of_the_classes(priors, expected):
    found = class_priors(priors, CLASSES, COUNTS)
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, expected, rtol=1e-14)


@pytest.mark.parametrize(
    ("priors", "message"),
    [
        ({"dry": 0.5, "new": 0.5, "worn": 0, "wet": 0}, "unknown: ['wet'], missing: []."),
        ({"dry": 0.5, "new": 0.5}, "unknown: [], missing: ['worn']."),
        ([0.5, 0.5], "for each of the 3 classes ['dry', 'new', 'worn']"),
        ([[0.5, 0.5, 0.0]], "got [[0.5, 0.5, 0.0]]"),
        ([0.2, 0.3, 0.5 + 2e-6], "add up to 1"),
        ([0.2, 0.3, 0.5 - 2e-6], "add up to 1"),
        ([0.6, 0.6, -0.2], "at least 0, "),
    ],
)
def test_priors_that_are_no_distribution_over_the_classes_are_refused(priors, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        class_priors(priors, CLASSES, COUNTS)
