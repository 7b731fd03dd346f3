"""Facts about the inner loops: the compiled ones do what those in NumPy do."""

import importlib.util
import os
import subprocess
import sys

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from emacm import _kernels
from emacm._kernels import numpy as _kernels_numpy
from emacm.resampling.spreading import decimating_filter, kernel_halves

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("numba") is None, reason="numba is not installed (extra 'fast')"
)
TAPS = decimating_filter()
both_types = pytest.mark.parametrize("dtype", [np.float64, np.float32])


@pytest.fixture
def compiled():
    from emacm._kernels import numba as _kernels_numba

    return _kernels_numba


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def agree(one, other):
    tolerance = 1e-12
    np.testing.assert_allclose(one, other, rtol=tolerance, atol=tolerance * np.abs(other).max())


@both_types
@pytest.mark.parametrize("n_times", [1, 2, 256, 257, 1024, 1281, 100_000])
def test_integrals_agree_with_the_running_sum_to_the_last_bit(compiled, rng, dtype, n_times):
    velocity = rng.standard_normal(n_times).astype(dtype)
    running = cumulative_trapezoid(velocity.astype(float), dx=1 / 48_000, initial=0)
    velocity.flags.writeable = False
    for module in (compiled, _kernels_numpy):
        for first in (0, n_times // 3):
            part = module.integrate(velocity[first:], 0.5 / 48_000, running[first])
            np.testing.assert_array_equal(part, running[first:])


def spread(module, near, scale, offset, signals, means, grid):
    """Spread samples as one part, after which nothing is decimated."""
    one_part = len(near) - 2, np.array([grid.shape[1] - 10]), np.array([0])
    rows = kernel_halves(), signals, means, grid
    module.resample(near, (scale, offset), *rows, one_part, (2, TAPS), (grid[:, :0], 0))


@both_types
@pytest.mark.parametrize("n_signals", [1, 2, 5, 8, 11])
@pytest.mark.parametrize("scale", [3.0, -3.0])
@pytest.mark.parametrize("n_times", [1, 60, 10_000])  # several cells at a step, and many in a cell
def test_spreading_agrees(compiled, rng, dtype, n_signals, scale, n_times):
    near = np.sort([-0.01, *rng.uniform(0, 100, n_times), 100.01])
    signals = [rng.standard_normal(n_times).astype(dtype) for _ in range(n_signals)]
    means = rng.standard_normal(n_signals)
    grids = np.zeros((2, n_signals, 290))  # the last samples lie beyond
    for module, grid in zip((compiled, _kernels_numpy), grids, strict=True):
        spread(module, near, scale, 2.5 if scale > 0 else 280.0, signals, means, grid)
    assert np.all(grids[:, :, 280:] == 0)
    assert np.abs(grids).max() > 0
    agree(grids[0], grids[1])


@both_types
@pytest.mark.parametrize("n_signals", [1, 5, 9])
def test_resampling_part_by_part_is_spreading_and_decimating(compiled, rng, dtype, n_signals):
    near = np.sort([-0.01, *rng.uniform(0, 100, 1000), 100.01])
    signals = [rng.standard_normal(1000).astype(dtype) for _ in range(n_signals)]
    means = rng.standard_normal(n_signals)
    n_points, ready = np.array([200, 180, 230, 150]), np.array([30, 0, 60, 50])
    grids, outputs = np.zeros((3, n_signals, 290)), np.full((3, n_signals, 150), 7.0)
    for module, grid, made in zip((compiled, _kernels_numpy), grids, outputs, strict=False):
        rows = kernel_halves(), signals, means, grid
        parts = 300, n_points, ready
        module.resample(near, (3.0, 2.5), *rows, parts, (2, TAPS), (made, 5))
    offset, done = 2.5, 5
    for k, (used, n_outputs) in enumerate(zip(n_points, ready, strict=True)):
        rows = [row[300 * k : 300 * (k + 1)] for row in signals]
        held = np.pad(grids[2][:, :used], ((0, 0), (0, 10)))
        spread(_kernels_numpy, near[300 * k : 300 * (k + 1) + 2], 3.0, offset, rows, means, held)
        grids[2][:, :used] = held[:, :used]
        if n_outputs:
            filtered = (2, TAPS), means, (outputs[2], done)
            _kernels_numpy.decimate(grids[2], used, *filtered, n_outputs)
        offset, done = offset - 2.0 * n_outputs, done + n_outputs
    assert done == 145
    assert np.abs(grids[2]).max() > 0
    for k in range(2):
        agree(grids[k], grids[2])
        agree(outputs[k], outputs[2])


@both_types
@pytest.mark.parametrize("factor", [2, 3, 7])
@pytest.mark.parametrize("beyond", [0, 1, 2])
@pytest.mark.parametrize("n_outputs", [1, 5, 400])
def test_upsampling_agrees(compiled, rng, dtype, factor, beyond, n_outputs):
    signal = rng.standard_normal(40 + -(-n_outputs // factor)).astype(dtype)
    taps = np.hanning(32 * factor + 3)[1:-1]
    one, other = (
        module.upsample(signal, taps, factor, 16 * factor + beyond, n_outputs)
        for module in (compiled, _kernels_numpy)
    )
    assert one.dtype == other.dtype == np.float64
    assert one.shape == (n_outputs,)
    agree(one, other)


def test_decimation_is_a_convolution_of_which_every_other_point_is_kept(rng):
    grid = rng.standard_normal(200)
    found = np.empty((1, 50))
    filtered = (3, TAPS), np.zeros(1), (found, 0)
    _kernels_numpy.decimate(grid[np.newaxis].copy(), 200, *filtered, 50)
    found = found[0]
    np.testing.assert_allclose(found, np.convolve(grid, TAPS)[43 : 43 + 100 : 2], atol=1e-12)


@both_types
@pytest.mark.parametrize("n_signals", [1, 5, 9])
def test_linear_interpolation_agrees(compiled, rng, dtype, n_signals):
    reached = np.maximum.accumulate(np.cumsum(rng.uniform(-0.2, 1, 30_000)))
    n_angles = int((reached[-1] - reached[0]) / 0.3)
    signals = [rng.standard_normal(30_000).astype(dtype) for _ in range(n_signals)]
    found = np.empty((2, n_signals, n_angles))
    for module, values in zip((compiled, _kernels_numpy), found, strict=True):
        module.interpolate_linear(reached, 4, 0.3, signals, values)
    agree(*found)


def test_a_plateau_at_the_start_is_passed_at_its_first_sample(compiled):
    for module in (compiled, _kernels_numpy):
        values = np.empty((1, 2))
        module.interpolate_linear(np.array([0.5, 0.5, 1.0]), 0, 1.0, [np.arange(3.0)], values)
        np.testing.assert_array_equal(values, [[0.0, 2.0]])


# Which of them are used


def test_kernels_can_be_named_for_a_while():
    with _kernels.using("numpy"):
        assert _kernels.loops is _kernels_numpy
        with _kernels.using("numba"):
            assert _kernels.loops.__name__ == "emacm._kernels.numba"
        assert _kernels.loops is _kernels_numpy


def in_a_new_process(code, **environment):
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_an_unknown_choice_in_the_environment_is_refused(monkeypatch):
    monkeypatch.setenv("EMACM_KERNELS", "c")
    with pytest.raises(ValueError, match=r"EMACM_KERNELS must be one of .*; got 'c'"):
        _kernels.__getattr__("loops")


def test_without_numba_its_kernels_name_the_extra(compiled, monkeypatch):
    monkeypatch.delitem(sys.modules, compiled.__name__)
    monkeypatch.setitem(sys.modules, "numba", None)
    with pytest.raises(ImportError, match=r"install emacm\[fast\]"), _kernels.using("numba"):
        pass


@pytest.mark.slow
def test_numba_is_imported_only_when_a_recording_is_processed():
    code = (
        "import sys, emacm, numpy as np\n"
        "run = emacm.Recording({'a': np.ones(99)}, 10, velocity=np.ones(99))\n"
        "resampler = emacm.OrderResampler()\n"
        "resampler.fit([run])\n"
        "assert 'numba' not in sys.modules\n"
        "resampler.transform([run])[0].strokes[0].signals\n"
        "assert 'numba' in sys.modules"
    )
    found = in_a_new_process(code, EMACM_KERNELS="numba")
    assert found.returncode == 0, found.stderr
