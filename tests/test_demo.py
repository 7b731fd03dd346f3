"""The demonstration: what it prints, saves and draws is what its models decide."""

import contextlib
import io
import re

import numpy as np
import pytest
from matplotlib.image import imread
from sklearn.metrics import confusion_matrix

from emacm import demo, load_model
from emacm.__main__ import main
from emacm.simulation import simulate_fleet


def parsed_decisions(text):
    """Read the confusion tables, rates and costs that were printed."""
    found = []
    for block in text.split("\nCosts: ")[1:]:
        rows = re.findall(r"^decision: (.+?)((?: +\d+)+)$", block, re.M)
        heading = next(line for line in block.splitlines() if "true: " in line)
        found.append(
            {
                "truths": [name.strip() for name in heading.split("true: ")[1:]],
                "table": {name.strip(): [int(n) for n in row.split()] for name, row in rows},
                "rates": {
                    name: (int(count), int(total))
                    for name, count, total in re.findall(
                        r"^([a-z ]+) rate: .*\((\d+) of (\d+) recordings\)$", block, re.M
                    )
                },
                "cost": float(re.search(r"in service: ([\d.]+);", block).group(1)),
                "missed": float(re.search(r"missed detection ([\d.]+)", block).group(1)),
            }
        )
    return found


def assert_printed(printed, truths, decisions, missed):
    """Compare with scikit-learn's confusion matrix, whose rows are the truth."""
    names, rows = printed["truths"], list(printed["table"])
    assert rows == [*names, "inspect", "unknown"]
    expected = confusion_matrix(truths, decisions, labels=rows)[: len(names)].T
    assert [printed["table"][name] for name in rows] == expected.tolist()
    h = names.index("healthy")
    others = [k for k in range(len(names)) if k != h]
    assert printed["rates"] == {
        "false alarm": (expected[others, h].sum(), expected[:, h].sum()),
        "inspection": (expected[-2:, h].sum(), expected[:, h].sum()),
        "missed detection": (expected[h, others].sum(), expected[:, others].sum()),
    }
    prices = np.ones((len(rows), len(names)))
    np.fill_diagonal(prices, 0)
    prices[h, others] = missed
    prices[-2] = 0.5
    assert printed["missed"] == missed
    paid = (expected * prices).sum(axis=0) / expected.sum(axis=0)
    shares = [0.9 if name == "healthy" else 0.1 / len(others) for name in names]
    assert printed["cost"] == pytest.approx(paid @ shares, abs=5e-4)


def test_printed_figures_are_those_of_the_decisions(capsys):
    truths = np.repeat(["worn", "healthy", "split"], [7, 5, 4])
    decisions = np.array(
        ["healthy"] * 2 + ["worn"] * 3 + ["split", "inspect"]
        + ["healthy"] * 2 + ["worn", "inspect", "inspect"]
        + ["split", "split", "split", "healthy"]
    )  # fmt: skip
    cost = demo.cost_matrix(["split", "healthy", "worn"], 7)
    demo.print_decisions(truths, decisions, cost)
    (printed,) = parsed_decisions(capsys.readouterr().out)
    assert printed["rates"] == {
        "false alarm": (1, 5), "inspection": (2, 5), "missed detection": (3, 11)
    }  # fmt: skip
    assert_printed(printed, truths, decisions, 7.0)


def test_figures_in_service_are_weighted_to_realistic_priors(capsys):
    truths = np.repeat(["healthy", "worn"], [10, 5])
    decisions = np.array(
        ["healthy"] * 2 + ["worn"] + ["inspect"] * 5 + ["unknown"] * 2 + ["worn"] * 4 + ["healthy"]
    )
    demo.print_decisions(truths, decisions, demo.cost_matrix(["healthy", "worn"], 9))
    printed = capsys.readouterr().out
    assert (
        "cost of a recording in service: 0.675; always 'inspect' 0.500, always 'healthy' 0.900, "
        "always 'unknown' 1.000\nThis model is worse than always 'inspect'"
    ) in printed


@pytest.mark.slow
def test_wrong_inputs_are_stated(run):
    printed = run["text"].split("with wrong inputs")[1].split("Model saved")[0]
    names = re.findall(r"^([a-z].+): decision '.+'$", printed, re.M)
    assert names == ["gain of 1000", "channels swapped", "speed in rpm"]
    for words in ("60 dB above training", "is it in rpm?"):
        assert words in printed


def test_a_missed_detection_is_the_expensive_error_and_priors_sum_to_one():
    cost = demo.cost_matrix(["a", "b", "healthy"], 30)
    assert cost.loc["healthy"].tolist() == [30, 30, 0]
    assert cost["healthy"].tolist() == [1, 1, 0, 0.5, 1]
    assert demo.priors(["a", "b", "healthy"]) == pytest.approx(
        {"a": 0.05, "b": 0.05, "healthy": 0.9}
    )


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Run the simulated demonstration with few units; keep what it printed and drew."""
    folder, kept = tmp_path_factory.mktemp("demo"), {"decided": []}
    sizes = iter([(3, 2), (2, 2)])

    def fleet(n_units, n_runs, **options):
        return simulate_fleet(*next(sizes), **options | {"severity": (0.3, 0.6)})

    def search(*args, **options):
        kept["search"] = options
        return grid_search(*args, **options)

    def printing(truths, decisions, cost):
        kept["decided"].append((truths, decisions, cost))
        print_decisions(truths, decisions, cost)

    grid_search = demo.GridSearchCV
    print_decisions = demo.print_decisions
    stdout, stderr = io.StringIO(), io.StringIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(stdout),
        contextlib.redirect_stderr(stderr),
    ):
        patch.setattr(demo, "simulate_fleet", fleet)
        patch.setattr(demo, "GridSearchCV", search)
        patch.setattr(demo, "print_decisions", printing)
        assert main(["demo", "--out", str(folder), "--jobs", "3"]) == 0
    unseen, truths, _ = simulate_fleet(2, 2, severity=(0.3, 0.6), seed=1, first_unit=8)
    kept |= {"text": stdout.getvalue(), "progress": stderr.getvalue(), "folder": folder}
    return kept | {"unseen": unseen, "truths": truths}


@pytest.mark.slow
def test_the_demo_prints_the_decisions_of_its_models_under_both_cost_matrices(run):
    model = load_model(run["folder"] / "simulated.emacm")
    features, classes = model[:-1].transform(run["unseen"]), model.classes_.tolist()
    posterior = model[-1].predict_proba(features)
    printed = parsed_decisions(run["text"])
    assert len(printed) == len(run["decided"]) == 2
    for (truths, decisions, cost), figures, missed in zip(
        run["decided"], printed, (4.0, 20.0), strict=True
    ):
        assert truths.tolist() == run["truths"].tolist()
        unknown = model[-1].unknown_proba(features)[:, np.newaxis]
        of_unknown = [1, 1, 1, 0.5, 0]  # costs of the decisions if the state is unknown
        prices = np.column_stack([cost[classes], of_unknown])  # rows are decisions
        risk = np.hstack([posterior * (1 - unknown), unknown]) @ prices.T
        assert decisions.tolist() == cost.index.to_numpy()[risk.argmin(axis=1)].tolist()
        assert_printed(figures, truths, decisions, missed)


@pytest.mark.slow
def test_the_saved_model_has_the_first_costs_and_realistic_priors(run):
    model = load_model(run["folder"] / "simulated.emacm")
    assert model[-1].cost.loc["healthy"].to_dict() == {
        "healthy": 0, "inner ring": 4, "screw": 4
    }  # fmt: skip
    assert model[-1].cost["healthy"].to_dict() == {
        "healthy": 0, "inner ring": 1, "screw": 1, "inspect": 0.5, "unknown": 1
    }  # fmt: skip
    assert model[-1].priors == pytest.approx({"healthy": 0.9, "inner ring": 0.05, "screw": 0.05})
    assert model[1].memory is None
    assert model.predict(run["unseen"]).tolist() == run["decided"][0][1].tolist()


@pytest.mark.slow
def test_the_search_is_stated_and_uses_as_many_threads_as_wanted(run):
    assert run["search"]["n_jobs"] == 3
    assert run["progress"] == "search: 48 fits\n"
    assert "best of 12 settings" in run["text"]


@pytest.mark.slow
def test_probabilities_and_expected_costs_are_printed_beside_each_other(run):
    rows = run["text"].split("of the test set:\n")[1].splitlines()[1:]
    rows = [line.replace("inner ring", "inner_ring").split() for line in rows if line.strip()]
    model = load_model(run["folder"] / "simulated.emacm")
    chosen, truths = run["unseen"][::6], run["truths"][::6]
    for row, truth, recording in zip(rows, truths, chosen, strict=False):
        features = model[:-1].transform([recording])
        assert row[-1].replace("_", " ") == truth
        assert row[0].replace("_", " ") == model[-1].predict(features)[0]
        expected = [model[-1].risk(features)[0].min(), *model[-1].typicality(features)]
        known = 1 - model[-1].unknown_proba(features)[0]
        expected += [*known * model[-1].predict_proba(features)[0]]
        assert np.array(row[1:-1], float) == pytest.approx(expected, abs=6e-4)


@pytest.mark.slow
def test_a_picture_is_drawn(run):
    assert imread(run["folder"] / "simulated.png").shape[1] == 6.3 * 150  # 16 cm at 150 dpi
