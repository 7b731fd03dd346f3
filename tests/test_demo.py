"""The demonstration: what it prints, saves and draws is what its models decide."""

import contextlib
import io

import numpy as np
import pandas as pd
import pytest
from matplotlib.image import imread
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm import CostSensitiveGaussianBayes, demo, load_model
from emacm.__main__ import main
from emacm.displays.drawing import offscreen_panels
from emacm.simulation import simulate_fleet


def test_printed_figures_are_those_of_the_decisions_with_nine_of_ten_units_healthy(capsys):
    truths = np.repeat(["healthy", "screw"], [10, 5])
    decided = ["healthy", "screw", "inspect", "unknown", "screw", "healthy"]
    decisions = np.repeat(decided, [2, 1, 5, 2, 4, 1])
    demo.print_decisions(truths, decisions, demo.cost_matrix(9).drop(columns="inner ring"))
    printed = capsys.readouterr().out.splitlines()
    assert printed[1] == "A missed detection costs 9:"
    rows = {line.rsplit(maxsplit=2)[0]: [*map(int, line.split()[-2:])] for line in printed[3:8]}
    assert rows == {
        "healthy": [2, 1], "inner ring": [0, 0], "screw": [1, 4], "inspect": [5, 0],
        "unknown": [2, 0],
    }  # fmt: skip
    # Healthy ones cost (1 + 7 / 2) / 10 each, the others 9 / 5.
    mean = (0.9 * 0.45 + 0.05 * 1.8) / 0.95
    assert printed[8:] == [
        f"these: {mean:.3f}", "always 'healthy': 0.474", "always 'inspect': 0.500"
    ]  # fmt: skip


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Run the demonstration with few units; keep what it printed and drew."""
    folder, sizes = tmp_path_factory.mktemp("demo"), iter([(3, 2), (2, 2)])

    def fleet(n_units, n_runs, **options):
        return simulate_fleet(*next(sizes), **options)

    stdout = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(stdout):
        patch.setattr(demo, "simulate_fleet", fleet)
        assert main(["demo", "--out", str(folder)]) == 0
    unseen, truths, _ = simulate_fleet(2, 2, severity=(0.1, 0.5), seed=1, first_unit=8)
    return {"text": stdout.getvalue(), "folder": folder, "unseen": unseen, "truths": truths}


@pytest.mark.slow
def test_the_demo_prints_its_search_and_the_decisions_of_the_saved_model_and_draws(run):
    model = load_model(run["folder"] / "simulated.emacm")
    assert model[-1].priors == demo.PRIORS
    pd.testing.assert_frame_equal(model[-1].cost, demo.cost_matrix(4))
    for missed in (4, 20):
        cost = demo.cost_matrix(missed)
        decisions = model.set_params(costsensitivegaussianbayes__cost=cost).predict(run["unseen"])
        printed = run["text"].split(f"costs {missed}:\n")[1].splitlines()[1:]
        for decision, line in zip(cost.index, printed, strict=False):
            made = [np.sum(decisions[run["truths"] == name] == decision) for name in demo.STATES]
            assert line.split() == [*decision.split(), *map(str, made)]
    assert "totalling 48 fits" in run["text"]
    assert "best of 12 settings" in run["text"]
    assert imread(run["folder"] / "simulated.png").shape[1] == 6.3 * 150  # 16 cm at 150 dpi


@pytest.mark.slow
def test_the_picture_has_one_legend_and_rings_what_is_decided_otherwise_at_the_other_cost(
    run, tmp_path, monkeypatch
):
    figure, axes = offscreen_panels(2, 2)
    monkeypatch.setattr(demo, "offscreen_panels", lambda *args, **options: (figure, axes))
    truths = run["truths"]
    plane = np.random.default_rng(0).normal(size=(len(truths), 2))
    plane[:, 0] += 3 * (truths != "healthy")
    models = {}
    for missed in (4.0, 20.0):
        cost = demo.cost_matrix(missed).drop("unknown")
        bayes = CostSensitiveGaussianBayes(cost, priors=demo.PRIORS, shrinkage=0.5)
        models[missed] = make_pipeline(FunctionTransformer(lambda recordings: plane), bayes)
        models[missed].fit(run["unseen"], truths)
    demo.draw_picture(models, run["unseen"], truths, tmp_path / "picture.png")
    assert len(figure.legends) == 1
    assert not any(ax.get_legend() for ax in axes.flat)
    at_4, at_20 = (model.predict(run["unseen"]) for model in models.values())
    assert 0 < np.sum(at_4 != at_20) < len(truths)
    for ax in axes[1]:
        np.testing.assert_allclose(ax.collections[-1].get_offsets(), plane[at_4 != at_20])
