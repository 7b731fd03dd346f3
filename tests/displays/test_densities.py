"""The ellipses are those of the densities that the classifier uses."""

import numpy as np
import pytest

from emacm import CostSensitiveGaussianBayes
from emacm.displays import FeatureDensityDisplay


def two_classes(n_recordings=4000):
    rng = np.random.default_rng(1)
    healthy = rng.multivariate_normal([0, 0], [[1, 0.8], [0.8, 2]], n_recordings)
    worn = rng.multivariate_normal([6, -3], [[2, -0.5], [-0.5, 0.5]], n_recordings)
    return np.concatenate([healthy, worn]), np.repeat(["healthy", "worn"], n_recordings)


@pytest.mark.parametrize("covariance", ["full", "tied", "diag"])
def test_every_point_of_an_ellipse_has_the_same_density(covariance, ax):
    X, y = two_classes(200)
    model = CostSensitiveGaussianBayes(covariance=covariance, priors="uniform").fit(X, y)
    display = FeatureDensityDisplay.from_estimator(model, X, y, ax=ax)
    for number in (0, 1):
        on_line = model.predict_joint_log_proba(display.ellipse(number, 0.9).T)[:, number]
        at_mean = model.predict_joint_log_proba(model.means_)[number, number]
        # exp(-r²/2) = 1 - share, so that is how far the density has fallen.
        assert np.allclose(on_line, at_mean + np.log(0.1))


def test_a_classifier_of_more_than_two_features_is_refused(ax):
    X, y = two_classes(20)
    model = CostSensitiveGaussianBayes().fit(np.column_stack([X, X[:, ::-1] ** 2]), y)
    with pytest.raises(ValueError, match="was fitted on 4"):
        FeatureDensityDisplay.from_estimator(model, X, y, ax=ax)
