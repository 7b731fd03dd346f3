"""Facts about the axis: names that are exact, and a table that carries them."""

import copy
import pickle

import joblib
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from emacm import BinTransformer
from emacm.orders.columns import (
    OrderTable,
    column_names,
    number_name,
    order_columns,
    parse_order_columns,
)

COLUMNS = order_columns(["current"], [0, 0.25, 0.5])
ORDERS = st.floats(0, 1e6, allow_nan=False)
CHANNELS = st.text("ab5@+-. \n\0µ電", min_size=1, max_size=12)


def table(columns=COLUMNS):
    return OrderTable(np.arange(12.0).reshape(4, 3), columns)


# The table


def through_joblib(value, folder):
    joblib.dump(value, folder / "table.joblib")
    return joblib.load(folder / "table.joblib")


@pytest.mark.parametrize(
    "through",
    [
        lambda value, folder: pickle.loads(pickle.dumps(value)),
        through_joblib,
        lambda value, folder: copy.deepcopy(value),
        lambda value, folder: value.copy(),
    ],
    ids=["pickle", "joblib", "deepcopy", ".copy"],
)
def test_names_survive_copies_and_files(through, tmp_path):
    again = through(table(), tmp_path)
    assert isinstance(again, OrderTable)
    assert again.columns == COLUMNS
    np.testing.assert_array_equal(again, table())


@pytest.mark.parametrize(
    "rows",
    [
        slice(1, 3),
        np.array([3, 0, 0]),
        [True, False, True, False],
        (np.array([3, 0]), ...),
        (slice(0, 2), slice(None)),
        ...,
        np.array([], dtype=int),
    ],
    ids=repr,
)
def test_a_choice_of_rows_keeps_the_names(rows):
    chosen = table()[rows]
    assert chosen.columns == COLUMNS
    np.testing.assert_array_equal(chosen, np.arange(12.0).reshape(4, 3)[rows])


@pytest.mark.parametrize(
    "change",
    [
        lambda X: X[:, [2, 0, 1]],
        lambda X: X[..., ::-1],
        lambda X: X[:, np.array([True, True, False])],
        lambda X: X[0],
        lambda X: X[None],
        lambda X: X[X > 3],
        lambda X: X.T,
        lambda X: X + 1,
        lambda X: X @ np.eye(3),
        lambda X: X.reshape(3, 4),
        lambda X: X.mean(axis=0),
        lambda X: np.flip(X, axis=1),
        lambda X: np.hstack([X, X]),
    ],
)
def test_names_are_gone_after_anything_but_a_choice_of_rows(change):
    assert column_names(change(table())) is None


def test_a_table_without_its_names_is_refused_where_orders_are_needed():
    with pytest.raises(ValueError, match=r"order table.*removed its orders"):
        BinTransformer(max_order=2).fit(table()[:, [2, 0, 1]])


def test_a_view_with_exchanged_axes_leaves_the_table_its_names():
    X = table()
    assert column_names(np.swapaxes(X, 0, 1)) is None
    assert column_names(X) == COLUMNS
    assert BinTransformer(max_order=0.5).fit_transform(X).shape == (4, 1)


def test_joblib_hashes_equal_tables_alike():
    assert joblib.hash(table()) == joblib.hash(table())


def test_joblib_hashes_equal_numbers_with_different_names_apart():
    assert joblib.hash(table()) != joblib.hash(table(order_columns(["current"], [0, 0.5, 1])))


# Names


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_reads_back_from_its_name_exactly(number):
    assert float(number_name(number)) == number


@pytest.mark.parametrize(
    ("number", "name"), [(5.0, "5"), (0.5, "0.5"), (10, "10"), (0.1 + 0.2, "0.30000000000000004")]
)
def test_the_name_of_a_number_is_the_shortest_that_is_exact(number, name):
    assert number_name(number) == name


@given(
    st.lists(CHANNELS, min_size=1, max_size=3, unique=True),
    st.lists(ORDERS, min_size=1, max_size=8, unique=True).map(sorted),
)
def test_names_read_back_as_the_channels_and_the_very_orders(channels, orders):
    assume(len({abs(order) for order in orders}) == len(orders))  # -0.0 is 0
    blocks = parse_order_columns(order_columns(channels, orders))
    assert [block.channel for block in blocks] == channels
    for number, block in enumerate(blocks):
        assert block.orders.tolist() == orders
        assert block.columns == slice(number * len(orders), (number + 1) * len(orders))


@pytest.mark.parametrize(
    "columns",
    [
        ["mean", "rms"],
        [0, 1, 2],
        ["a@x", "b@"],
        ["a@5-6", "a@6-7"],
        ["a@nan", "a@inf"],
        ["a@-1"],
        [("a@", 1), None],
    ],
)
def test_other_names_carry_no_axis(columns):
    assert parse_order_columns(columns) is None


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        *((text, "'a@0' and 'unit'.*Select") for text in ("unit a@0", "a@0 unit a@1", "a@0 unit")),
        ("a@0 a@2 a@1", "must increase, but column 'a@1' follows 'a@2'"),
        ("a@0 b@0 a@1", r"adjacent.*\['a', 'b', 'a'\]"),
    ],
)
def test_columns_that_make_no_axis_are_refused_by_name(columns, message):
    with pytest.raises(ValueError, match=message):
        parse_order_columns(columns.split())


def test_names_must_be_those_of_fit():
    bins = BinTransformer(max_order=0.5).fit(table())
    assert bins.get_feature_names_out(COLUMNS).tolist() == bins.get_feature_names_out().tolist()
    with pytest.raises(ValueError, match="input_features is not equal to feature_names_in_"):
        bins.get_feature_names_out(COLUMNS[::-1])
    bins = BinTransformer(max_order=0.5).fit(table().tolist())
    with pytest.raises(ValueError, match=r"length equal to what fit saw \(3\), got 2"):
        bins.get_feature_names_out(["a", "b"])
