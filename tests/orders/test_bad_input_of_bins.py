"""Facts about bad input of order bins: what was expected, what came, where, what to do."""

import numpy as np
import pandas as pd
from bad_input import Case, T, V, check_refused, each, spectra

from emacm import BinTransformer
from emacm.orders.columns import order_columns


def bins(X=None, **options):
    return BinTransformer(**({"max_order": 8} | options)).fit_transform(
        spectra() if X is None else X
    )


CASES = [
    Case("orders above the axis", lambda: bins(max_order=50), V, "16-17|beyond the spectrum"),
    Case("edges above the axis", lambda: bins(edges=[0, 5, 16.01]), V, "5-16.01|0 to 16"),
    Case(
        "edges below the axis",
        lambda: bins(pd.DataFrame(np.ones((2, 3)), columns=["a@1", "a@2", "a@3"]), edges=[0.5, 2]),
        V,
        "0.5-2|1 to 3",
    ),
    *[
        Case(
            f"{name}={value!r}",
            lambda name=name, value=value: bins(**{name: value}),
            error,
            name,
            "number",
        )
        for name in ("bin_size", "max_order")
        for value, error in [(0, V), (-1, V), (np.nan, V), ("1", T), (None, T)]
    ],
    Case("tiny bins", lambda: bins(bin_size=1e-300), V, "bin_size = 1e-300|bins up to order 8"),
    Case("edges that are not sorted", lambda: bins(edges=[0, 5, 3]), V, "edges|increase"),
    Case("a negative edge", lambda: bins(edges=[-1, 3]), V, "edges|at least 0"),
    Case("an edge that is no number", lambda: bins(edges=[0, np.nan]), V, "edges|finite"),
    Case("one edge", lambda: bins(edges=[3]), V, "edges|at least 2"),
    Case("text for edges", lambda: bins(edges=["a", "b"]), T, "edges|numeric"),
    Case("no bands", lambda: bins(edges={}), V, "edges|at least one band"),
    Case(
        "a band upside down",
        lambda: bins(edges={"BPFI": (6, 5)}),
        V,
        "band 'BPFI'|lower to a higher",
    ),
    Case(
        "a band of one number", lambda: bins(edges={"BPFI": 6}), T, "band 'BPFI'|pair (low, high)"
    ),
    *(
        Case(
            f"a band named {name}",
            lambda name=name: bins(edges={name: (5, 6)}),
            V,
            f"band {name!r} of edges",
            "orders 5 to 6",
        )
        for name in ("6-7", "5.5", "sideband@5")
    ),
    Case("a band with a number as its name", lambda: bins(edges={1: (1, 2)}), T, "strings, got 1"),
    Case("a negative band", lambda: bins(edges={"x": (-1, 6)}), V, "band 'x'|at least 0"),
    Case(
        "a stop band that is not nested", lambda: bins(stop_bands=(5.6, 6.4)), T, "stop band 0|pair"
    ),
    Case(
        "a stop band upside down",
        lambda: bins(stop_bands=((6.4, 5.6),)),
        V,
        "stop band 0|lower to a higher",
    ),
    Case("text for stop bands", lambda: bins(stop_bands="5-6"), T, "stop band 0|pair"),
    Case("a negative stop band", lambda: bins(stop_bands=((-1, 2),)), V, "stop band 0|at least 0"),
    Case("all bins stopped", lambda: bins(stop_bands=((0, 8),)), V, "stop_bands|(0.0, 8.0)"),
    Case("a step of zero", lambda: bins(np.ones((2, 9)), order_step=0), V, "order_step|above 0"),
    Case(
        "bins beyond a stated step",
        lambda: bins(np.ones((2, 9)), order_step=0.5),
        V,
        "beyond the spectrum|0 to 4",
    ),
    Case(
        "columns reordered after fit",
        lambda: (
            BinTransformer(max_order=8)
            .fit(pd.DataFrame(np.ones((1, 18)), columns=order_columns("ab", range(9))))
            .transform(pd.DataFrame(np.ones((1, 18)), columns=order_columns("ba", range(9))))
        ),
        V,
        "expected 18 columns 'a@0' to 'b@8', got 18 columns 'b@0' to 'a@8'",
    ),
    Case(
        "columns of one name",
        lambda: bins(pd.DataFrame(np.ones((2, 3)), columns=["a@0", "a@1", "a@1"]), max_order=1),
        V,
        "X has columns of the same name|'a@1'",
    ),
]


@each(CASES)
def test_bad_input_is_refused_with_what_where_and_what_to_do(case):
    check_refused(case)
