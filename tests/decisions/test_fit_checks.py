"""Facts about the checks of parameters, weights and fitted densities, with their limits."""

import numpy as np
import pytest
from sklearn.base import BaseEstimator, ClassifierMixin

from emacm import CostSensitiveGaussianBayes, LeastRiskClassifier, evaluate

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


def test_priors_fit_before_a_classifier_is_fitted():
    trusting = Trusting()
    trusting.fit = None
    with pytest.raises(ValueError, match="add up to 1"):
        LeastRiskClassifier(trusting, priors=[0.5, 0.6]).fit(np.zeros((2, 2)), CLASSES)


def test_two_recordings_are_enough_and_one_is_not():
    model = CostSensitiveGaussianBayes().fit([[1.0], [3.0]], ["new", "new"])
    assert model.covariances_.tolist() == [[[2.0]]]
    with pytest.raises(ValueError, match="minimum of 2 is required"):
        CostSensitiveGaussianBayes().fit([[1.0]], ["new"])
    one = CostSensitiveGaussianBayes().partial_fit([[1.0]], ["new"], ["new", "worn"])
    assert one.partial_fit([[3.0]], ["new"]).covariances_[0].tolist() == [[2.0]]
