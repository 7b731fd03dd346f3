"""Facts about the checks of parameters, weights and fitted densities, with their limits."""

import re

import numpy as np
import pytest
from sklearn.base import BaseEstimator, ClassifierMixin

from emacm import CostSensitiveGaussianBayes, LeastRiskClassifier, evaluate
from emacm.decisions.fit_checks import (
    agreed_classes,
    check_densities,
    check_parameters,
)
from emacm.decisions.moments import ClassMoments

CLASSES = np.array(["dry", "new"])


class Trusting(ClassifierMixin, BaseEstimator):
    """Checks nothing."""

    def fit(self, X, y):
        self.classes_ = np.unique(y)
        return self

    def predict(self, X):
        return np.full(len(X), self.classes_[0])

    def predict_proba(self, X):
        return np.full((len(X), len(self.classes_)), 1 / len(self.classes_))


@pytest.mark.parametrize(
    "fit",
    [
        lambda X, y: CostSensitiveGaussianBayes().fit(X, y),
        lambda X, y: CostSensitiveGaussianBayes().partial_fit(X, y, [0.5, 1.5]),
        lambda X, y: LeastRiskClassifier(Trusting()).fit(X, y),
        lambda X, y: evaluate(Trusting(), X, y),
    ],
)
def test_measurements_are_no_classes(fit):
    with pytest.raises(ValueError, match="Unknown label type"):
        fit(np.arange(8.0).reshape(4, 2), [0.5, 0.5, 1.5, 1.5])


def test_each_recording_has_a_class_and_priors_fit_before_a_classifier_is_fitted():
    with pytest.raises(ValueError, match=r"inconsistent numbers of samples: \[4, 3\]"):
        LeastRiskClassifier(Trusting()).fit(np.zeros((4, 2)), ["dry", "new", "new"])
    trusting = Trusting()
    trusting.fit = None
    with pytest.raises(ValueError, match="must add up to 1"):
        LeastRiskClassifier(trusting, priors=[0.5, 0.6]).fit(np.zeros((2, 2)), CLASSES)


def test_two_recordings_are_enough_and_one_is_not():
    model = CostSensitiveGaussianBayes().fit([[1.0], [3.0]], ["new", "new"])
    assert model.covariances_.tolist() == [[[2.0]]]
    with pytest.raises(ValueError, match="minimum of 2 is required"):
        CostSensitiveGaussianBayes().fit([[1.0]], ["new"])
    one = CostSensitiveGaussianBayes().partial_fit([[1.0]], ["new"], ["new", "worn"])
    assert one.partial_fit([[3.0]], ["new"]).covariances_[0].tolist() == [[2.0]]


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (("spherical", None, None), "covariance must be one of 'full', 'tied', 'diag'"),
        (("full", "lw", None), "shrinkage as a word must be one of 'oas', 'auto'"),
        (("full", 1.01, None), 'shrinkage, if not None, "oas" or "auto", must be a number at lea'),
        (("full", -0.01, None), "at least 0 and at most 1, got -0.01"),
        (("full", None, "units"), "temperature as a word must be one of 'groups'"),
        (("full", None, 0), 'temperature, if not None or "groups", must be a number above 0'),
    ],
)
def test_parameters_have_limits(parameters, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        check_parameters(*parameters)


def test_classes_are_sorted_and_stay_the_same():
    assert agreed_classes(["new", "dry", "new"], None).tolist() == ["dry", "new"]
    assert agreed_classes(None, CLASSES) is CLASSES
    assert agreed_classes(["new", "dry"], CLASSES).tolist() == ["dry", "new"]
    with pytest.raises(ValueError, match="classes must be given in the first call"):
        agreed_classes(None, None)
    with pytest.raises(ValueError, match=r"got \['new'\], previously \['dry', 'new'\]"):
        agreed_classes(["new"], CLASSES)


def moments(counts, scatter, pooled=False):
    means = np.array([[0.0], [3.0]])
    return ClassMoments(np.array(counts), means, np.array(scatter)[:, None, None], pooled)


@pytest.mark.parametrize(
    ("counts", "scatter", "pooled", "named"),
    [
        ([1.0, 4.0], [0.5, 2.0], False, "class 'dry' has a total weight of [1.0]"),
        ([0.5, 0.9], [0.5, 2.0], False, "class 'dry', 'new' has a total weight of [0.5, 0.9]"),
        ([0.5, 1.5], [2.0], True, "all classes has a total weight of [2.0]"),
    ],
)
def test_a_class_that_varies_counts_more_than_once(counts, scatter, pooled, named):
    singular = np.zeros(len(scatter), bool)
    with pytest.raises(ValueError, match=re.escape(named)):
        check_densities(moments(counts, scatter, pooled), singular, CLASSES, 0.1, stacklevel=1)


def test_equal_recordings_cannot_be_separated():
    equal = ClassMoments(np.ones(2), np.full((2, 1), 3.0), np.zeros((2, 1, 1)), False)
    with pytest.raises(ValueError, match="all recordings have the same features"):
        check_densities(equal, np.ones(2, bool), CLASSES, None, stacklevel=1)
