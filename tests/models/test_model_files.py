"""Model files: equal posteriors, foreign types refused, no byte of a file may change."""

import io
import json
import subprocess
import sys
import warnings
import zipfile
from functools import reduce
from hashlib import sha256

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

import emacm
from emacm import (
    BandPowers,
    Bearing,
    BinTransformer,
    CepstralPrewhitening,
    ConditionRouter,
    CostSensitiveGaussianBayes,
    EnvelopeDetector,
    FaultLines,
    FeatureBaseline,
    GearIndicators,
    LeastRiskClassifier,
    NewUnitClassifier,
    OrderCrossSpectrum,
    OrderPSD,
    OrderResampler,
    PosteriorProduct,
    Recording,
    SignalBaseline,
    SynchronousAverage,
    actuator_recipe,
    describe_model,
    load_model,
    save_model,
)
from emacm.models import model_files

pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
RNG = np.random.default_rng(2)
WITHOUT_FIT = set()  # estimators that are in no model below
STATES = np.array(["normal", "normal", "worn", "worn", "old", "old"] * 4)
FRAME = pd.DataFrame(
    [[0, 4.0, 1.5], [2, 0, 7], [0.3, 0.3, 0.3]],
    index=["normal", "worn", "inspect"],
    columns=["normal", "worn", "old"],
)


def recording(number):
    """Six seconds of forward and reverse strokes."""
    times = np.arange(3000) / 500
    velocity = np.where(times % 2 < 1, 29.0, -29.0)
    level = 1 + "now".index(STATES[number][0])
    signals = {"vib": level * RNG.normal(size=3000), "amp": RNG.normal(size=3000) + 0.3 * level}
    meta = {"load": (20, 40)[number % 2], "unit": "AB"[number // 12]}
    return Recording(signals, 500, velocity=velocity, meta=meta)


X = [recording(number) for number in range(len(STATES))]
ANGLES = OrderResampler(2 * np.pi / 20)
LOG = FunctionTransformer(np.log10)
SPECTRA = (ANGLES, OrderPSD(1.5), BinTransformer(max_order=6), LOG)
BAYES = CostSensitiveGaussianBayes(covariance="diag", shrinkage=0.2)
CLASSES = ["normal", "worn", "old"]


def bayes(**options):
    return CostSensitiveGaussianBayes(**{"covariance": "tied", "shrinkage": "auto"} | options)


COSTS = {
    "none": None,
    "mapping": {("normal", "worn"): 20, ("inspect", "old"): 0.2}
    | {("inspect", name): 0.5 for name in ("normal", "worn")},
    "array": np.array([[0, 1, 2.5], [3, 0, 1], [1, 9, 0]]),
    "frame": FRAME,
}
MODELS = {
    **{f"cost {name}": make_pipeline(*SPECTRA, bayes(cost=cost)) for name, cost in COSTS.items()},
    "priors": make_pipeline(*SPECTRA, bayes(priors={"normal": 0.9, "worn": 0.04, "old": 0.06})),
    "unknown": make_pipeline(*SPECTRA, bayes(unknown="unknown", temperature="groups")),
    "router": ConditionRouter(make_pipeline(*SPECTRA, BAYES), ("load", "unit")),
    "signal baseline": make_pipeline(
        ANGLES, SignalBaseline(healthy="normal", baseline_recordings=X[:2]), *SPECTRA[1:], BAYES
    ),
    "feature baseline": make_pipeline(
        FeatureBaseline(make_pipeline(*SPECTRA), condition=("unit", "load"), healthy="normal"),
        BAYES,
    ),
    "band": make_pipeline(FeatureBaseline(BandPowers(), condition="unit", healthy="normal"), BAYES),
    "recipe": actuator_recipe(max_order=4, cost=COSTS["mapping"]),
    "envelope": make_pipeline(EnvelopeDetector((50, 100), channels=["vib"]), *SPECTRA, BAYES),
    "new units": make_pipeline(*SPECTRA, NewUnitClassifier(COSTS["mapping"])),
    "gear": make_pipeline(ANGLES, GearIndicators(5), BAYES),
    "synchronous average": make_pipeline(ANGLES, SynchronousAverage(), *SPECTRA[1:], BAYES),
    "prewhitening": make_pipeline(CepstralPrewhitening(), *SPECTRA, BAYES),
    "risk": make_pipeline(*SPECTRA, LeastRiskClassifier(LogisticRegression(), COSTS["mapping"])),
    "product": make_pipeline(*SPECTRA, PosteriorProduct([("a", BAYES), ("b", bayes())], FRAME)),
    "fault lines": make_pipeline(
        ANGLES, OrderPSD(4), FaultLines([Bearing(7, 9.0, 39.04)], harmonics=1), BAYES
    ),
    "named bins": make_pipeline(
        ANGLES, OrderPSD(4), BinTransformer(edges={"BPFI": (2, 3.1), "x": (4, 5)}), BAYES
    ),
    "cross spectrum": make_pipeline(ANGLES, OrderCrossSpectrum(1.5, max_order=5), BAYES),
    "search": GridSearchCV(
        make_pipeline(*SPECTRA, bayes(cost=COSTS["mapping"])),
        {"costsensitivegaussianbayes__shrinkage": [0.1, 0.3]},
        cv=2,
    ),
}


@pytest.fixture(scope="module")
def fitted():
    models = {}

    def model(name):
        if name not in models:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", "fit was called without groups")
                # Two runs of each unit and state, in the order of STATES.
                units = {"newunitclassifier__groups": np.arange(len(X)) // 6}
                options = units if name == "new units" else {}
                models[name] = MODELS[name].fit(X, STATES, **options)
        return models[name]

    return model


@pytest.fixture
def saved(fitted, tmp_path):
    save_model(fitted("cost mapping"), tmp_path / "model.emacm", note="bench 3")
    return tmp_path / "model.emacm"


# Equal results


@pytest.mark.filterwarnings("ignore:.*phase of the mesh")  # there is none in noise
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in ("named bins", "risk") else pytest.mark.slow)
        for name in MODELS
        if not name.startswith("cost")  # see below
    ],
)
def test_a_loaded_model_gives_the_same_posteriors_bit_by_bit(fitted, tmp_path, name):
    model = fitted(name)
    save_model(model, tmp_path / "model.emacm")
    loaded = load_model(tmp_path / "model.emacm")
    some = X[::5]
    np.testing.assert_array_equal(loaded.predict_proba(some), model.predict_proba(some))
    np.testing.assert_array_equal(loaded.predict(some), model.predict(some))


@pytest.mark.parametrize("name", [name for name in MODELS if name.startswith("cost")])
def test_costs_of_every_form_are_restored(fitted, tmp_path, name):
    model = fitted(name)[-1]
    save_model(model, tmp_path / "model.emacm")
    loaded = load_model(tmp_path / "model.emacm")
    np.testing.assert_array_equal(loaded.cost_, model.cost_)
    assert loaded.decisions_.tolist() == model.decisions_.tolist()
    assert type(loaded.cost) is type(model.cost)
    if isinstance(model.cost, dict):
        assert loaded.cost == model.cost


def test_every_public_estimator_is_in_one_of_the_models_or_can_be_saved(tmp_path, fitted):
    kinds = {type(part) for name in MODELS for part in model_files.parts_of(MODELS[name])}
    public = {
        value
        for value in (getattr(emacm, name) for name in emacm.__all__)
        if isinstance(value, type) and issubclass(value, emacm._saved.SavedEstimator)
    }
    assert {kind.__name__ for kind in public - kinds} <= WITHOUT_FIT
    for kind in public - kinds:
        save_model(kind(), tmp_path / "m.emacm")
        assert type(load_model(tmp_path / "m.emacm")) is kind


def test_a_baseline_stores_what_was_learned_and_no_recordings(fitted, tmp_path):
    model = fitted("signal baseline")
    save_model(model, tmp_path / "model.emacm")
    loaded = load_model(tmp_path / "model.emacm")
    stored = loaded.named_steps["signalbaseline"].baseline_recordings
    assert stored[0].endswith(X[0].digest)
    assert (tmp_path / "model.emacm").stat().st_size < 100_000
    with pytest.raises(ValueError, match=r"set baseline_recordings again: .* is not stored"):
        loaded.fit(X, STATES)


# The description


def test_the_description_states_what_is_known_of_the_model(saved, fitted):
    about = describe_model(saved)
    assert about["note"] == "bench 3"
    assert about["classes"] == ["normal", "old", "worn"]
    assert about["decisions"] == fitted("cost mapping")[-1].decisions_.tolist()
    assert about["channels"] == ["vib", "amp"]
    assert about["versions"]["emacm"] == emacm.__version__
    assert np.shape(about["cost"]) == (4, 3)
    assert about["priors"] == pytest.approx([1 / 3] * 3)
    assert len(about["check"][0]["posterior"]) == 6
    assert about["training_range"][0] is not None


def test_the_card_states_what_any_of_several_resamplers_was_trained_on(saved):
    about = describe_model(saved)
    (own,) = about["training_range"]
    low, high = own["revolutions"]
    about["training_range"] = [own | {"revolutions": [low / 2, high]}, own | {"x": [1, 2]}]
    table = about.tables()["Operating conditions of the training"]
    assert table.loc["revolutions"].tolist() == [f"{low / 2:.5g}", f"{high:.5g}"]
    assert table.loc["x"].tolist() == ["1", "2"]


# Other versions


def rewritten(path, change):
    """Change the description of a model file, with a correct digest."""
    content = path.read_bytes()
    start = len(model_files._START)
    body = content[start + 65 :]
    length = int.from_bytes(body[:8], "little")
    about = json.loads(body[8 : 8 + length])
    stored = change(about, body[8 + length :])
    text = json.dumps(about).encode()
    body = len(text).to_bytes(8, "little") + text + stored
    path.write_bytes(content[:start] + sha256(body).hexdigest().encode() + b"\n" + body)


def test_another_version_warns_and_replays_the_check_rows(saved):
    def older(about, stored):
        about["versions"]["emacm"] = "0.0.7"
        return stored

    rewritten(saved, older)
    with pytest.warns(UserWarning, match=r"saved under other versions: emacm 0\.0\.7 \(here"):
        load_model(saved)


def test_other_posteriors_of_the_check_rows_are_an_error(saved):
    def changed(about, stored):
        about["check"][0]["posterior"][2][0] += 0.01
        return stored

    rewritten(saved, changed)
    with pytest.raises(ValueError, match="check rows give other posteriors"):
        load_model(saved)


def test_a_damaged_schema_with_a_correct_digest_is_refused(saved):
    def damaged(about, stored):
        return with_schema(stored, lambda schema: replaced(schema, b'.npy"', b'.gone"'))

    rewritten(saved, damaged)
    with pytest.raises(ValueError, match="cannot be read"):
        load_model(saved)


# What is refused


class Foreign(StandardScaler):
    """A step of the user."""


def plus_one(values):
    return values + 1


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (Foreign(), "Foreign"),
        (FunctionTransformer(plus_one), "plus_one"),
        (FunctionTransformer(lambda values: values), "lambda|cannot hold"),
        (FunctionTransformer(inv_kw_args={"a": (i for i in ())}), "cannot hold"),
    ],
)
def test_foreign_types_are_refused_by_name(tmp_path, step, message):
    model = make_pipeline(step, BAYES).fit(RNG.normal(size=(24, 3)), STATES)
    with pytest.raises(TypeError, match=message):
        save_model(model, tmp_path / "model.emacm")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("model", "folder", "error", "message"),
    [
        (clone(BAYES).fit(RNG.normal(size=(24, 3)), STATES), "later", FileNotFoundError, "later"),
        (3, "", TypeError, "not an estimator instance"),
        (StandardScaler, "", TypeError, "is a class, not an instance"),
        (clone(BAYES), "", NotFittedError, "not fitted yet"),
        (clone(make_pipeline(StandardScaler(), BAYES)), "", NotFittedError, "not fitted yet"),
    ],
)
def test_what_cannot_be_saved_is_refused(tmp_path, model, folder, error, message):
    with pytest.raises(error, match=message):
        save_model(model, tmp_path / folder / "model.emacm")


def test_a_missing_file_is_an_error(tmp_path):
    for read in (load_model, describe_model):
        with pytest.raises(FileNotFoundError, match="there is no model"):
            read(tmp_path / "none.emacm")


def test_without_skops_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "skops.io", None)
    model = clone(BAYES).fit(np.arange(6.0)[:, None], ["new", "worn"] * 3)
    with pytest.raises(ImportError, match=r"pip install 'emacm\[models\]'"):
        save_model(model, tmp_path / "model.emacm")


def with_schema(stored, change):
    """Change the schema inside of the archive that skops has written."""
    with zipfile.ZipFile(io.BytesIO(stored)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    members["schema.json"] = change(members["schema.json"])
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()


EXECUTED = []


def watch(event, arguments):
    if event in ("os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "socket.connect"):
        EXECUTED.append((event, arguments))


@pytest.mark.parametrize(
    "name",
    [
        ("os", "system"),
        ("subprocess", "Popen"),
        ("builtins", "eval"),
        ("emacm.decisions.no_module", "Classifier"),
        ("emacm.decisions.classifier", "check_is_fitted"),
        ("sklearn.datasets._openml", "fetch_openml"),
        ("sklearn.utils._testing", "TempMemmap"),
    ],
)
def test_a_forged_file_with_a_correct_digest_executes_nothing(saved, name):
    sys.addaudithook(watch)
    old = b'"__class__": "CostSensitiveGaussianBayes", "__module__": "emacm.decisions.classifier"'
    new = f'"__class__": "{name[1]}", "__module__": "{name[0]}"'.encode()

    def forged(about, stored):
        return with_schema(stored, lambda schema: replaced(schema, old, new))

    rewritten(saved, forged)
    EXECUTED.clear()
    with pytest.raises((TypeError, ValueError), match=name[0]):
        load_model(saved)
    assert not EXECUTED


def test_a_file_whose_classes_have_moved_or_gone_is_refused_with_the_remedy(saved):
    names = {b'"CostSensitiveGaussianBayes"': b'"Moved"', b"emacm.decisions.gau": b"emacm.gone.gau"}

    def forged(about, stored):
        return with_schema(
            stored, lambda schema: reduce(lambda s, n: s.replace(*n), names.items(), schema)
        )

    rewritten(saved, forged)
    with pytest.raises(ValueError, match=r"emacm\.gone.* Save the model again"):
        load_model(saved)


@pytest.mark.parametrize("name", ["log10", "seterrobj"])
def test_functions_of_numpy_1_are_loaded_if_they_compute_element_by_element(tmp_path, name):
    path = tmp_path / "model.emacm"
    model = make_pipeline(LOG, CostSensitiveGaussianBayes(covariance="diag"))
    features = RNG.uniform(1, 2, (24, 2))
    save_model(model.fit(features, STATES), path)
    module = "numpy" if np.__version__ >= "2" else "numpy.core._multiarray_umath"
    old = f'"__class__": "log10", "__module__": "{module}"'.encode()
    new = f'"__class__": "{name}", "__module__": "numpy.core._multiarray_umath"'.encode()
    rewritten(path, lambda _, x: with_schema(x, lambda schema: replaced(schema, old, new)))
    if name == "log10":
        np.testing.assert_array_equal(load_model(path).predict(features), model.predict(features))
        return
    with pytest.raises(TypeError, match=name):
        load_model(path)


def replaced(schema, old, new):
    changed = json.dumps(json.loads(schema)).encode().replace(old, new)
    assert new in changed
    return changed


def test_mutated_files_are_refused_and_execute_nothing(saved):
    sys.addaudithook(watch)
    EXECUTED.clear()
    content, rng = saved.read_bytes(), np.random.default_rng(11)
    for number in range(500):
        changed = bytearray(content)
        place = int(rng.integers(len(content)) if number % 4 else rng.integers(200))
        if number % 3 == 0:
            changed[place] ^= 1 << int(rng.integers(8))
        elif number % 3 == 1:
            del changed[place : place + int(rng.integers(1, 50))]
        else:
            changed[place:place] = rng.bytes(int(rng.integers(1, 9)))
        saved.write_bytes(changed)
        with pytest.raises(ValueError, match=r"damaged|not a model file"):
            load_model(saved)
    assert not EXECUTED


@pytest.mark.slow
def test_a_model_is_loaded_without_dask_and_pytest(tmp_path):
    save_model(LogisticRegression().fit([[0.0], [1.0]], [0, 1]), tmp_path / "model.emacm")
    code = "import sys, emacm; emacm.load_model('model.emacm'); print(*sys.modules)"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert not {"dask", "pytest"} & set(done.stdout.split())
