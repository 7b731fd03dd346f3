"""Facts about the recipe for actuators."""

from copy import deepcopy
from functools import cache

import numpy as np
import pytest

from emacm import Recording, ShaftHarmonics
from emacm.models.recipes import actuator_recipe

FS, TURN = 100.0, 2 * np.pi
STATES = ("normal", "worn1", "worn2")


def stroke_angle(jitter=0.0, seed=0):
    """Rest, out over 20 revolutions, rest, and back."""
    speed = np.repeat([0.0, 20.0, 0.0, -20.0], [60, 630, 90, 630])
    noise = np.random.default_rng(seed).standard_normal(len(speed)) * jitter
    return 0.4 + np.cumsum(speed) / FS + noise


def actuator(state="normal", load=20, seed=0, zero=0.0, wave=0.0):
    """Current and position error, which answers the current; a wave that stands at `wave`."""
    rng, angle = np.random.default_rng(seed), stroke_angle()
    strength = 0.3 * STATES.index(state)
    current = load / 20 + (1 + strength) * 0.1 * np.cos(angle - wave)
    current += 0.05 * (1 + 3 * strength) * rng.standard_normal(len(angle))
    error = np.convolve(current, [0.5, 0.3, 0.2], "same") + 0.02 * rng.standard_normal(len(angle))
    channels = {"current": current, "error": error}
    return Recording(
        channels, FS, angle=angle + zero, meta={"load": load, "state": state, "run": seed}
    )


def campaign(n=4, loads=(20, 40), **options):
    X = [
        actuator(state, load, seed, **options)
        for seed in range(n)
        for state in STATES
        for load in loads
    ]
    return X, np.array([x.meta["state"] for x in X])


def recipe(**options):
    return actuator_recipe(max_order=3, min_speed=2, **options)


def fitted(X, y, model=None, **options):
    model = recipe(**options) if model is None else model
    return model.fit(X, y, costsensitivegaussianbayes__groups=[x.meta["run"] for x in X])


@cache
def trained(variant="without phase"):
    """Return a variant of the recipe, fitted to a campaign."""
    return fitted(*campaign(), **VARIANTS[variant])


VARIANTS = {
    "without phase": {},
    "with phase": {"phase": True},
    "relative to healthy": {"phase": True, "healthy": "normal"},
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_states_of_a_made_up_actuator_are_recognised_in_new_recordings(variant):
    new, truth = [actuator(s, 20, 100 + k) for k, s in enumerate(STATES)], list(STATES)
    assert trained(variant).predict(new).tolist() == truth


def test_without_phase_features_do_not_see_where_the_wave_stands():
    X, _ = campaign(1)
    features = recipe()[0].fit(X)
    # Two whole turns of difference, so that windows and segments see the same noise.
    moved = [actuator(x.meta["state"], x.meta["load"], 0, wave=1.7) for x in X]
    names = features.get_feature_names_out()
    waves = [k for k, name in enumerate(names) if "in_phase" in name or "quadrature" in name]
    known, found = features.transform(X)[:, waves], features.transform(moved)[:, waves]
    np.testing.assert_allclose(found, known, atol=0.02)
    absolute = ShaftHarmonics((1,), min_speed=2, min_revolutions=1)
    assert np.abs(absolute.fit_transform(moved) - absolute.fit_transform(X)).max() > 0.1


def test_without_phase_machines_that_are_put_together_anew_are_recognised():
    known, found = ({s: k + t for k, s in zip((0, 2, 4), STATES, strict=True)} for t in (0, 2))
    X = [actuator(s, 20, seed, wave=known[s]) for seed in range(5) for s in STATES]
    y = [x.meta["state"] for x in X]
    new = [actuator(s, 20, 100 + seed, wave=found[s]) for seed in range(2) for s in STATES]
    truth = [x.meta["state"] for x in new]
    assert fitted(X, y, unknown_rate=None).predict(new).tolist() == truth
    # With phase each is taken for the one whose wave stood there in training.
    mistaken = fitted(X, y, phase=True, unknown_rate=None).predict(new).tolist()
    assert not any(a == b for a, b in zip(mistaken, truth, strict=True))


def test_without_phase_the_zero_of_the_shaft_angle_changes_nothing():
    X, _ = campaign(1)
    features = recipe()[0].fit(X)
    turned = [actuator(x.meta["state"], x.meta["load"], 0, zero=2.0) for x in X]
    known, found = features.transform(X), features.transform(turned)
    np.testing.assert_allclose(found, known, rtol=1e-8, atol=1e-8)
    assert trained().predict(turned).tolist() == trained().predict(X).tolist()


@pytest.mark.parametrize("options", VARIANTS.values(), ids=VARIANTS)
def test_every_feature_has_a_name_of_its_own(options):
    X, y = campaign(2, loads=(20,))
    features = recipe(**options)[:-1].fit(X, y)
    names = features.get_feature_names_out()
    assert len(set(names)) == len(names) == features.transform(X).shape[1]
    assert {"current+@0-0.25", "current+:mean", "current*error:coherence+@1-1.25"} <= set(names)


def another_machine(seed):
    """Another current, another mechanism, and a load that the shaft angle does not determine."""
    rng, angle = np.random.default_rng(seed), stroke_angle()
    current = 0.4 + 0.2 * np.cos(2 * angle) + 0.2 * rng.standard_normal(len(angle))
    error = np.convolve(current, [0.1, -0.4, 0.9], "same")
    meta = {"load": 20, "run": seed}
    return Recording({"current": current, "error": error}, FS, angle=angle, meta=meta)


@pytest.mark.parametrize("variant", VARIANTS)
def test_another_machine_is_unknown(variant):
    model = deepcopy(trained(variant))
    new = [another_machine(seed) for seed in range(3)]
    assert model.predict(new).tolist() == ["unknown"] * 3
    assert model.set_params(costsensitivegaussianbayes__unknown=None).predict(new)[0] in STATES


def test_without_groups_single_recordings_are_left_out_with_a_warning():
    X, y = campaign(5, loads=(20,))
    with pytest.warns(UserWarning, match="make the model over-confident"):
        model = recipe().fit(X, y)
    assert model.predict([another_machine(1)]).tolist() == ["unknown"]


@pytest.mark.filterwarnings("ignore:recording 4.* is constant")  # the error says it too
@pytest.mark.parametrize(("channel", "level"), [("current", 0.7), ("error", 0.0)])
def test_a_dead_channel_is_named_with_its_recording(channel, level):
    X, y = campaign(3, loads=(20,))
    model = fitted(X, y)
    dead = dict(X[4].signals) | {channel: np.full(len(X[4].signals[channel]), level)}
    X[4] = Recording(dead, FS, angle=X[4].angle, meta=X[4].meta)
    message = rf"recording 4.* '{channel}.*[Cc]heck its sensor, or leave"
    for call in (lambda: model.predict(X), lambda: fitted(X, y)):
        with np.errstate(all="ignore"), pytest.raises(ValueError, match=message):
            call()


def test_a_machine_with_one_direction_needs_no_setting():
    rng = np.random.default_rng(5)
    angle = np.cumsum(2 * np.pi * (9 + rng.uniform(size=3000))) / 300
    runs = [
        Recording(
            {
                "torque": np.sin(angle) + (1 + k % 2) * rng.standard_normal(3000),
                "current": np.cos(angle) + rng.standard_normal(3000),
            },
            300,
            angle=angle,
        )
        for k in range(8)
    ]
    states = ["normal", "worn"] * 4
    groups = {"costsensitivegaussianbayes__groups": [k // 2 for k in range(8)]}
    recipe = actuator_recipe().set_output(transform="pandas").fit(runs, states, **groups)
    columns = recipe[:-1].transform(runs).columns
    assert not any("+" in name.partition("@")[0].partition(":")[0] for name in columns)
    assert list(recipe.predict(runs)) == states


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"revolutions": 0}, "revolutions"),
        ({"max_order": 0.5}, r"max_order must be a number at least 0\.83"),
        ({"revolutions": 8, "max_order": 500}, "max_order, the bins, must be .* at most 1000, got"),
        ({"phase": "relative"}, "phase"),
        ({"healthy": "normal"}, r"healthy = 'normal' needs phase=True.*same assemblies"),
    ],
)
def test_parameters_that_are_impossible_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        actuator_recipe(**options)
