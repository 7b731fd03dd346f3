"""Checks of scikit-learn for classifiers with an unknown state and with a temperature."""

import pytest
from sklearn.utils.estimator_checks import parametrize_with_checks

from emacm.decisions.classifier import CostSensitiveGaussianBayes

CONFIGURATIONS = [
    CostSensitiveGaussianBayes(unknown="unknown"),
    CostSensitiveGaussianBayes(temperature="groups"),
    CostSensitiveGaussianBayes(temperature=2.5),
    CostSensitiveGaussianBayes(covariance="tied", shrinkage=0.1, unknown=-7, temperature="groups"),
    CostSensitiveGaussianBayes(covariance="diag", unknown="new", temperature=3.0),
]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The covariance of .* is singular:UserWarning")
@pytest.mark.filterwarnings("ignore:fit was called without groups:UserWarning")
@parametrize_with_checks(CONFIGURATIONS)
def test_every_check_of_scikit_learn_passes(estimator, check):
    check(estimator)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:fit was called without groups:UserWarning")
@pytest.mark.parametrize("covariance", ["full", "tied", "diag"])
def test_every_check_passes_with_ledoit_wolf(covariance):
    model = CostSensitiveGaussianBayes(
        covariance=covariance, shrinkage="auto", unknown="unknown", temperature="groups"
    )
    checks = parametrize_with_checks([model]).args[1]
    for estimator, check in checks:
        if "sample_weight" not in str(check):  # weights are refused, with the reason
            check(estimator)
