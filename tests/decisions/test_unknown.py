"""Facts about the evidence for an unknown state."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import quad

from emacm.decisions.costs import evidence_for_unknown, unknown_probability


@pytest.mark.parametrize("rate", [None, 0.01, 0.4])
def test_the_evidence_of_known_recordings_has_the_mean_1(rate):
    limits = sorted([1e-12, 1e-6, 1e-2, rate or 0.5, 1])
    mean = sum(
        quad(lambda p: float(evidence_for_unknown(np.array(p), rate)), low, high, limit=500)[0]
        for low, high in itertools.pairwise(limits)
    )
    assert mean == pytest.approx(1, abs=0.04)  # 1 / log(1e12) lies below 1e-12


def test_the_evidence_is_the_mean_over_densities_of_unknown_recordings():
    p = np.array([1e-9, 1e-4, 0.03, 0.4, 0.9])
    expected = [quad(lambda xi, p=p: xi * p ** (xi - 1), 0, 1)[0] for p in p]
    assert_allclose(evidence_for_unknown(p), expected, rtol=1e-6)


@given(st.floats(1e-300, np.exp(-1)))
def test_the_evidence_stays_below_the_bound_of_sellke_bayarri_and_berger(p):
    assert evidence_for_unknown(np.array(p)) < -1 / (np.e * p * np.log(p))


def test_the_evidence_is_accurate_where_the_formula_changes():
    surprise = np.array([1e-6, 0.5e-4, 0.99e-4, 1.1e-4, 1.2e-4, 1.4e-4])
    series = 0.5 + surprise / 6 + surprise**2 / 24
    assert_allclose(evidence_for_unknown(np.exp(-surprise)), series, rtol=9e-10)
    assert evidence_for_unknown(np.array(1.0)) == 0.5


@given(st.floats(np.finfo(float).tiny, 1), st.floats(0, 1), st.none() | st.floats(0.001, 0.999))
def test_the_probability_lies_in_0_to_1_and_rises_as_typicality_falls(typicality, prior, rate):
    less = max(typicality / 2, np.finfo(float).tiny)
    found = unknown_probability(np.array([typicality, less]), prior, rate)
    assert np.isfinite(found).all()
    assert ((found >= 0) & (found <= 1)).all()
    assert found[1] >= found[0] * (1 - 1e-9)


@pytest.mark.parametrize("prior", [0.0, 1.0])
def test_a_certain_prior_stays_certain(prior):
    assert_allclose(unknown_probability(np.array([1.0, 0.2, 1e-308]), prior), prior)
