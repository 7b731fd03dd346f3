"""Strategies for anything a user may pass: a result without NaN, a ValueError or a TypeError."""

import warnings
from types import SimpleNamespace

import numpy as np
import pandas as pd
from bad_input import over_angle, run
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import sparse

NUMBERS = st.one_of(
    st.integers(-5, 50),
    # No sizes between what is quick and what is absurd.
    st.floats(-50, 50).map(lambda number: round(number, 3)),
    st.sampled_from([np.nan, np.inf, -np.inf, 1e300, 1e-300, 5e-324, 2**63, 1e-12]),
)
ARRAYS = st.one_of(
    *(
        hnp.arrays(dtype, hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5))
        for dtype in (np.float32, np.int16, np.bool_, np.complex128, "U2", "M8[s]")
    ),
    hnp.arrays(float, hnp.array_shapes(max_side=5), elements=st.floats(-50, 50) | st.just(np.nan)),
    hnp.arrays(object, hnp.array_shapes(max_dims=2, max_side=3), elements=st.none() | NUMBERS),
)
LEAVES = st.one_of(
    st.none(),
    st.booleans(),
    NUMBERS,
    st.complex_numbers(),
    st.text("ab5@ -\n\0é電", max_size=3),
    st.binary(max_size=3),
    st.sampled_from(["a", "b", "healthy", "worn", "hann", ("kaiser", 3), np.float64(2), object()]),
    ARRAYS,
    st.builds(lambda: run()),
    st.builds(lambda: over_angle()[0]),
    st.builds(lambda: pd.DataFrame({"a": [1.0, 2.0]})),
    st.builds(lambda: pd.Series([0.5, 0.5], ["healthy", "worn"])),
    st.builds(lambda: sparse.csr_array(np.eye(3))),
    st.builds(lambda: SimpleNamespace(meta=3, columns=5)),
    st.just(range(3)),
)
ANYTHING = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.tuples(inner, inner),
        st.dictionaries(st.sampled_from(["a", "b", "healthy", "worn", 0, ("a", "b")]), inner),
    ),
    max_leaves=6,
)
PLAUSIBLE = st.one_of(
    NUMBERS,
    st.lists(NUMBERS, max_size=4),
    st.lists(st.tuples(NUMBERS, NUMBERS), max_size=3),
    st.sampled_from(
        ["linear", "cubic", "forward", "reverse", "travel", "spectrum", "median", "pad", "flattop"]
    ),
    st.tuples(st.sampled_from(["kaiser", "tukey", "gaussian", "hann"]), NUMBERS),
    st.dictionaries(st.sampled_from(["BPFI", "a", "healthy", "worn"]), NUMBERS),
    st.dictionaries(st.sampled_from(["BPFI", "FTF"]), st.tuples(NUMBERS, NUMBERS)),
    hnp.arrays(float, (2, 2), elements=st.floats(-50, 50)),
    hnp.arrays(float, 64, elements=st.floats(-2, 2)),
    st.sampled_from(["oas", "auto", "tied", "diag", "uniform"]),
    st.lists(st.sampled_from("ab"), min_size=1, max_size=3),
)
VALUES = PLAUSIBLE | ANYTHING
FUZZ = settings(max_examples=60, suppress_health_check=list(HealthCheck))


def survive(call):
    """Return the numbers of a result; none if the input is refused as it should be."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            result = call()
        except (ValueError, TypeError):
            return np.zeros(0)
    return np.asarray(result, dtype=float)
