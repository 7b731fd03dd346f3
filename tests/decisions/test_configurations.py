"""Every check of scikit-learn in every configuration of the Gaussian classifier."""

import pytest
from sklearn.utils.estimator_checks import parametrize_with_checks

from emacm import CostSensitiveGaussianBayes

pytestmark = pytest.mark.slow

CONFIGURATIONS = [
    CostSensitiveGaussianBayes(priors="uniform"),
    CostSensitiveGaussianBayes(covariance="full", shrinkage="oas"),
    CostSensitiveGaussianBayes(covariance="tied", shrinkage="oas"),
    CostSensitiveGaussianBayes(covariance="diag", shrinkage=0),
]
SINGULAR = "its recordings have singular covariances, which are an error with any shrinkage"


def expected_failures(model):
    """Return the checks whose recordings are refused, as documented."""
    tied, shrinkage = model.covariance == "tied", model.shrinkage
    failures = {}
    if shrinkage == 0 or (shrinkage == "oas" and not tied):
        failures["check_sample_weight_equivalence_on_dense_data"] = SINGULAR
    if shrinkage == 0:
        failures["check_sample_weights_shape"] = SINGULAR
        failures["check_sample_weights_not_overwritten"] = SINGULAR
    return failures


@pytest.mark.filterwarnings("ignore:The covariance of .* is singular:UserWarning")
@parametrize_with_checks(CONFIGURATIONS, expected_failed_checks=expected_failures)
def test_every_check_of_scikit_learn_passes(estimator, check):
    check(estimator)


WITH_CALIBRATION = [
    CostSensitiveGaussianBayes(unknown="unknown"),
    CostSensitiveGaussianBayes(covariance="tied", shrinkage=0.1, unknown=-7, temperature="groups"),
    CostSensitiveGaussianBayes(covariance="diag", unknown="new", temperature=3.0),
]


@pytest.mark.filterwarnings("ignore:The covariance of .* is singular:UserWarning")
@pytest.mark.filterwarnings("ignore:fit was called without groups:UserWarning")
@parametrize_with_checks(WITH_CALIBRATION)
def test_every_check_passes_with_an_unknown_state_or_a_temperature(estimator, check):
    check(estimator)


@pytest.mark.filterwarnings("ignore:fit was called without groups:UserWarning")
def test_every_check_passes_with_ledoit_wolf():
    model = CostSensitiveGaussianBayes(
        covariance="tied", shrinkage="auto", unknown="unknown", temperature="groups"
    )
    checks = parametrize_with_checks([model]).args[1]
    for estimator, check in checks:
        if "sample_weight" not in str(check):  # weights are refused, with the reason
            check(estimator)
