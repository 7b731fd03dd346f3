"""The router, the baselines and evaluate read the conditions of recordings alike."""

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.preprocessing import FunctionTransformer

from emacm import ConditionRouter, FeatureBaseline, Recording, evaluate

FORMS = {
    "a key": ("load", lambda unit, load: load),
    "a tuple of keys": (("unit", "load"), lambda unit, load: (unit, load)),
    "a function": (lambda run: (run.meta["unit"], run.meta["load"] > 5), lambda u, n: (u, n > 5)),
}

PAIRS = st.tuples(st.sampled_from("CAB"), st.sampled_from([100, 3, 20]))


class SeenRows(ClassifierMixin, BaseEstimator):
    """Remembers the numbers of the recordings that it was fitted on."""

    def fit(self, X, y):
        self.rows_ = frozenset(run.meta["number"] for run in X)
        self.classes_ = np.unique(y)
        return self

    def predict(self, X):
        return np.full(len(X), self.classes_[0])


def parts_by_router(X, y, condition):
    models = ConditionRouter(SeenRows(), condition).fit(X, y).estimators_.values()
    return {model.rows_ for model in models}


def parts_by_baseline(X, y, condition):
    numbers = FunctionTransformer(lambda X: np.eye(len(X)))
    baseline = FeatureBaseline(numbers, condition=condition, healthy=["new", "worn"]).fit(X, y)
    return {frozenset(np.flatnonzero(mean).tolist()) for mean in baseline.means_.values()}


def parts_by_evaluate(X, y, condition, role="conditions"):
    roles = {role: condition, "n_splits": len(X)}  # one group is left out at a time
    rows = evaluate(SeenRows(), X, y, **roles).predictions
    held_out = rows[rows["scheme"] != "random split"].groupby("left_out")["recording"]
    return {frozenset(numbers) for _, numbers in held_out}


@settings(max_examples=9)
@given(
    st.lists(PAIRS, min_size=2, max_size=5),
    st.sampled_from([*FORMS]),
    st.sampled_from(["runs", "units", "conditions"]),
)
def test_the_router_the_baselines_and_evaluate_read_the_same_conditions(made, form, role):
    condition, value_of = FORMS[form]
    values = [value_of(*pair) for pair in made for _ in ("new", "worn")]
    assume(len(set(values)) > 1)
    y = ["new", "worn"] * len(made)
    X = []
    for number, (unit, load) in enumerate(pair for pair in made for _ in ("new", "worn")):
        meta = {"unit": unit, "load": load, "number": number}
        X.append(Recording({"current": [0.0, 1.0]}, 1, velocity=1.0, meta=meta))
    expected = {frozenset(np.flatnonzero([v == value for v in values])) for value in values}
    assert parts_by_router(X, y, condition) == expected
    assert parts_by_baseline(X, y, condition) == expected
    assert parts_by_evaluate(X, y, condition, role) == expected
