"""Facts about bad input of order bins: what was expected, what came, where, what to do."""

import numpy as np
import pandas as pd
from bad_input import Case, T, V, check_refused, each, spectra

from emacm import BinTransformer
from emacm.orders.columns import order_columns


def bins(X=None, **options):
    options = {"max_order": 8} | options
    return BinTransformer(**options).fit_transform(spectra() if X is None else X)


def frame(*columns):
    return pd.DataFrame(np.ones((2, len(columns))), columns=columns)


def reordered():
    fitted, other = (frame(*order_columns(names, range(9))) for names in ("ab", "ba"))
    return BinTransformer(max_order=8).fit(fitted).transform(other)


OPTIONS = [
    ("orders above the axis", {"max_order": 50}, V, "16-17|beyond the spectrum"),
    ("edges above the axis", {"edges": [0, 5, 16.01]}, V, "5-16.01|0 to 16"),
    ("tiny bins", {"bin_size": 1e-300}, V, "bin_size = 1e-300|bins up to order 8"),
    ("edges that are not sorted", {"edges": [0, 5, 3]}, V, "edges|increase"),
    ("a negative edge", {"edges": [-1, 3]}, V, "edges|at least 0"),
    ("an edge that is no number", {"edges": [0, np.nan]}, V, "edges|finite"),
    ("one edge", {"edges": [3]}, V, "edges|at least 2"),
    ("text for edges", {"edges": ["a", "b"]}, T, "edges|numeric"),
    ("no bands", {"edges": {}}, V, "edges|at least one band"),
    ("a band upside down", {"edges": {"BPFI": (6, 5)}}, V, "band 'BPFI'|lower to a higher"),
    ("a band of one number", {"edges": {"BPFI": 6}}, T, "band 'BPFI'|pair (low, high)"),
    ("a band with a number as its name", {"edges": {1: (1, 2)}}, T, "strings, got 1"),
    ("a negative band", {"edges": {"x": (-1, 6)}}, V, "band 'x'|at least 0"),
    ("a stop band that is not nested", {"stop_bands": (5.6, 6.4)}, T, "stop band 0|pair"),
    ("a stop band upside down", {"stop_bands": ((6.4, 5.6),)}, V, "stop band 0|lower to a higher"),
    ("a number for stop bands", {"stop_bands": 5}, T, "stop_bands|pairs|got 5"),
    ("a band without a name", {"edges": {"": (1, 2)}}, T, "named by strings, got ''"),
    ("text for stop bands", {"stop_bands": "5-6"}, T, "stop band 0|pair"),
    ("a negative stop band", {"stop_bands": ((-1, 2),)}, V, "stop band 0|at least 0"),
    ("all bins stopped", {"stop_bands": ((0, 8),)}, V, "stop_bands|(0.0, 8.0)"),
    *(
        (f"{name}={value!r}", {name: value}, error, f"{name}|number")
        for name in ("bin_size", "max_order")
        for value, error in [(0, V), (-1, V), (np.nan, V), ("1", T), (None, T)]
    ),
    *(
        (
            f"a band named {name}",
            {"edges": {name: (5, 6)}},
            V,
            f"band {name!r} of edges|orders 5 to 6",
        )
        for name in ("6-7", "5.5", "sideband@5")
    ),
]
CASES = [
    *(Case(what, lambda o=options: bins(**o), *error) for what, options, *error in OPTIONS),
    Case("edges below", lambda: bins(frame("a@1", "a@2"), edges=[0.5, 2]), V, "0.5-2|1 to 2"),
    Case("a step of zero", lambda: bins(np.ones((2, 9)), order_step=0), V, "order_step|above 0"),
    Case("a stated step", lambda: bins(np.ones((2, 9)), order_step=0.5), V, "beyond the|0 to 4"),
    Case("reordered", reordered, V, "18 columns 'a@0' to 'b@8', got 18 columns 'b@0' to 'a@8'"),
    Case("columns of one name", lambda: bins(frame("a@0", "a@1", "a@1")), V, "same name|'a@1'"),
]


@each(CASES)
def test_bad_input_is_refused_with_what_where_and_what_to_do(case):
    check_refused(case)
