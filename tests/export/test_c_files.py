"""Exported models: the C program computes and decides what Python does."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from controller import (
    FS,
    STATES,
    STRICT,
    Program,
    classifier,
    compared,
    cranfield,
    cranfield_model,
    noise_model,
    rows_of,
    simulated,
    simulated_model,
)
from sklearn.decomposition import PCA
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, SplineTransformer, StandardScaler

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    OrderPSD,
    OrderResampler,
    RecordingStatistics,
    export_c,
    save_model,
)
from emacm.__main__ import main

compiles = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler is installed")
LARGEST = {"float64": 1e-9, "float32": 1e-3}  # deviation of a feature
STATE = [STATES[k % 3] for k in range(30)]
LOG = FunctionTransformer(np.log10)
BINS = BinTransformer(2, max_order=20)


@pytest.fixture(scope="module")
def recordings():
    return [simulated(state, seed) for seed, state in enumerate(STATE)]


@pytest.fixture(scope="module")
def model():
    return simulated_model(45)


def resampler(per_revolution=52, **options):
    return OrderResampler(2 * np.pi / per_revolution, **{"min_speed": 2.0, **options})


def fitted(recordings, *steps):
    pipeline = make_pipeline(*steps)
    groups = {}
    if getattr(steps[-1], "unknown", None) is not None:
        groups = {"costsensitivegaussianbayes__groups": [k // 3 for k in range(len(STATE))]}
    return pipeline.fit(recordings, STATE, **groups)


def run_check(folder):
    sources = ["check.c", "emacm_model.c", "-lm", "-o", "check"]
    subprocess.run(["cc", *STRICT, "-O2", *sources], cwd=folder, check=True)
    done = subprocess.run(["./check"], cwd=folder, capture_output=True, text=True)
    return done.returncode, done.stdout


@compiles
@pytest.mark.parametrize("precision", LARGEST)
def test_the_check_beside_the_sources_finds_the_readings_of_python(model, precision, tmp_path):
    exported = export_c(model, tmp_path, fs=FS, precision=precision)
    status, text = run_check(tmp_path)
    assert status == 0
    assert "12 of 12 readings as in Python" in text
    size = int(text.split()[-2])
    assert size - 8 <= exported.ram <= size  # the compiler may pad it
    assert f"{exported.ram} bytes" in (tmp_path / "README.md").read_text()


CHAINS = {
    "rests end strokes": (resampler(max_rest=0.05), OrderPSD(4), BINS, LOG, classifier(STATES)),
    "gear, lines": (
        resampler(ratio=1.7, min_speed=0.0),
        OrderPSD(2, max_order=9),
        LOG,
        PCA(6),
        classifier(STATES),
    ),
    "directions, no overlap": (
        resampler(64),
        OrderPSD(3, overlap=0.0, by_direction=True, scaling="spectrum"),
        BinTransformer(0.7, max_order=20, stop_bands=((1.5, 2.2),)),
        StandardScaler(),
        CostSensitiveGaussianBayes(covariance="diag", shrinkage=0.1),
    ),
    "reverse, means remain": (
        resampler(direction="reverse"),
        OrderPSD(4, detrend=None, window=("kaiser", 8.0), overlap=0.7),
        BINS,
        LOG,
        LinearDiscriminantAnalysis(),
        CostSensitiveGaussianBayes(priors=dict(zip(STATES, (0.6, 0.3, 0.1), strict=True))),
    ),
    "upsampled, prior of the unknown state": (
        resampler(256),
        OrderPSD(2),
        BinTransformer(4, max_order=20),
        LOG,
        CostSensitiveGaussianBayes(
            shrinkage="oas",
            unknown="new",
            priors={"healthy": 0.5, "screw": 0.3, "bearing": 0.1, "new": 0.1},
            temperature=2.0,
        ),
    ),
}


@compiles
@pytest.mark.parametrize("name", CHAINS)
def test_decisions_and_features_are_those_of_the_monitor(name, recordings, tmp_path):
    chain = fitted(recordings, *CHAINS[name])
    others = [simulated(state, seed) for seed, state in enumerate(STATE[:6], 500)]
    for precision, every in (("float64", 7.5), ("float32", 0)):  # cut during strokes, and whole
        found = compared(chain, others, precision, tmp_path, every)
        assert found["decisions equal"] == found["readings"] > found["without a decision"]
        assert found["largest deviation of a feature"] <= LARGEST[precision]
        assert found["of a probability"] <= LARGEST[precision]


@compiles
def test_decisions_on_a_real_actuator_are_those_of_the_monitor(tmp_path, cranfield_file):
    X, y, runs = cranfield(cranfield_file)
    some = np.random.default_rng(1).permutation(len(X))[:100]
    X, y, runs = [X[k] for k in some], y[some], runs[some]
    chain = cranfield_model(X, y, runs)
    for precision, largest in LARGEST.items():
        found = compared(chain, X, precision, tmp_path)
        assert found["decisions equal"] == found["readings"] == 100
        assert found["largest deviation of a feature"] <= largest


@compiles
def test_the_order_of_the_channels_is_that_of_the_export(model, tmp_path):
    rows = rows_of(simulated("screw", 7))
    found = []
    for columns in ([0, 1, 2], [1, 0, 2]):
        channels = [("torque", "current")[k] for k in columns[:2]]
        options = {"fs": FS, "channels": channels, "max_speed": 120, "every": 5}
        export_c(model, tmp_path, **options, precision="float64")
        found += Program(tmp_path, "float64").readings(model, [rows[:, columns]])[:1]
    np.testing.assert_allclose(found[0]["features"], found[1]["features"], rtol=1e-12)


def spoiled(n_times, n_channels):
    """Return rows with NaN, infinity, reversals, standstill, and speeds that are too high."""
    rng = np.random.default_rng(3)
    kind = np.repeat(rng.integers(6, size=n_times // 500), 500)
    speed = np.choose(kind, [0.0, 100.0, -100.0, 1.9, -40.0, 3.0]) * np.ones(n_times)
    speed += np.where(kind > 2, 2.5, 0.0) * rng.normal(size=n_times)
    rows = np.column_stack([rng.normal(size=(n_times, n_channels)), speed])
    rows[rng.integers(n_times, size=n_times // 2000), -1] = 1e9
    rows[::997, 0] *= 1e30
    for value in (np.nan, np.inf, -np.inf):
        places = rng.integers(n_times, size=n_times // 20_000)
        rows[places, rng.integers(n_channels + 1, size=len(places))] = value
    return rows


@compiles
@pytest.mark.parametrize(
    ("per_revolution", "n_times"),  # the samples up to 2 and 4 times as dense
    [(52, 50_000), pytest.param(128, 1_000_000, marks=pytest.mark.slow)],
)
def test_no_input_makes_the_program_leave_its_arrays(per_revolution, n_times, recordings, tmp_path):
    steps = resampler(per_revolution), OrderPSD(2), BINS, LOG, classifier(STATES)
    export_c(fitted(recordings, *steps), tmp_path, fs=FS, max_speed=130, every=5)
    options = "-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"
    try:
        program = Program(tmp_path, "float32", options)
    except subprocess.CalledProcessError:
        pytest.skip("the compiler has no sanitizers")
    assert program.output([spoiled(n_times, 2)])  # some readings are complete


@compiles
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
def test_nothing_is_read_before_it_is_written(model, tmp_path):
    export_c(model, tmp_path, fs=FS, max_speed=130, every=5)
    checked = "valgrind", "-q", "--error-exitcode=9"
    assert Program(tmp_path, "float32", ("-O1", "-g")).output([spoiled(10_000, 2)], before=checked)


def test_a_model_of_three_channels_needs_at_most_64_kb(tmp_path):
    model, _ = noise_model(3, 128, 4000.0)  # segments of 16 revolutions
    assert export_c(model, tmp_path, fs=48_000, max_speed=360, every=16).ram <= 64 * 1024


REFUSED = {
    "SplineTransformer": (OrderPSD(4), BINS, SplineTransformer(), classifier(STATES)),
    "RecordingStatistics": (RecordingStatistics(), classifier(STATES)),
    "memory= of OrderPSD": (OrderPSD(4, memory="cache"), BINS, classifier(STATES)),
    "LinearDiscriminantAnalysis": (OrderPSD(4), BINS, LinearDiscriminantAnalysis()),
    'detrend="linear" of OrderPSD': (OrderPSD(4, detrend="linear"), BINS, classifier(STATES)),
    "average='median' of OrderPSD": (OrderPSD(4, average="median"), BINS, classifier(STATES)),
    "166 samples .* have 164": (OrderPSD(n_per_segment=166), BINS, classifier(STATES)),
    "207 samples .* have 208": (OrderPSD(n_per_segment=207), BINS, classifier(STATES)),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_exported_is_refused_by_its_name(name, recordings, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    chain = fitted(recordings, resampler(), *REFUSED[name])
    with pytest.raises(ValueError, match=name):
        export_c(chain, tmp_path / "c", fs=FS)
    assert not (tmp_path / "c").exists()


def test_samples_that_would_have_to_be_far_denser_are_refused(model, tmp_path):
    with pytest.raises(ValueError, match=r"max_speed = 2000 rad/s; at most 8 times"):
        export_c(model, tmp_path, fs=FS, max_speed=2000)


def test_a_rate_that_does_not_hold_the_orders_of_the_model_is_refused(model, tmp_path):
    speed = model[0].training_range_.ranges["fastest"][1]  # orders up to 20 are used
    with pytest.raises(ValueError, match=r"orders up to 10 .* uses orders up to 20\. Raise fs"):
        export_c(model, tmp_path, fs=10 * speed / np.pi)


def test_the_command_writes_the_sources_and_prints_their_memory(model, tmp_path, capsys):
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    save_model(model, tmp_path / "model.skops")
    options = ["--c", str(tmp_path / "c"), "--fs", "2000", "--channels", "current,torque"]
    assert main(["export", str(tmp_path / "model.skops"), *options, "--every", "5"]) == 0
    text = capsys.readouterr().out
    assert "emacm_model.c" in text
    assert "RAM " in text
    header = (tmp_path / "c" / "emacm_model.h").read_text()
    assert "#define EMACM_EVERY 5.0f" in header
    assert "current, torque" in header


@compiles
@pytest.mark.slow
def test_the_page_prints_what_its_program_prints(tmp_path, monkeypatch, capsys):
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    page = (Path(__file__).parents[2] / "notebooks" / "controller.md").read_text(encoding="utf-8")
    commands = re.search(r"```sh\n(.*?)```", page, re.DOTALL)[1].splitlines()
    monkeypatch.chdir(tmp_path)
    assert main(["example", "example"]) == 0
    monkeypatch.chdir("example")
    for command in commands[1:-1]:
        assert main(shlex.split(command)[1:]) == 0
    monkeypatch.chdir("controller")
    Path("main.c").write_text(re.search(r"```c\n(.*?)```", page, re.DOTALL)[1])
    build, check = commands[-1].partition(" && ")[2].split(" && ")
    build_main, *runs = re.findall(r"^\$ (.*)$", page, re.MULTILINE)
    for line in (build, check, build_main, *runs):
        done = subprocess.run(line, shell=True, capture_output=True, text=True, check=True)
        if done.stdout:
            assert done.stdout.splitlines()[-1] in page
