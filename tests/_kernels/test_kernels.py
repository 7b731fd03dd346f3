"""Facts about the inner loops: the compiled ones do what those in NumPy do."""

import importlib.util
import os
import subprocess
import sys

import numpy as np
import pytest
from scipy import fft
from scipy.integrate import cumulative_trapezoid

from emacm import _kernels
from emacm._kernels import numpy as _kernels_numpy
from emacm.resampling.spreading import _decimating_filter, _kernel_halves

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("numba") is None, reason="numba is not installed (extra 'fast')"
)
both_precisions = pytest.mark.parametrize(
    ("dtype", "tolerance"), [(np.float64, 1e-12), (np.float32, 1e-5)]
)


@pytest.fixture
def compiled():
    from emacm._kernels import numba as _kernels_numba

    return _kernels_numba


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def agree(one, other, tolerance=1e-12):
    np.testing.assert_allclose(one, other, rtol=tolerance, atol=tolerance * np.abs(other).max())


@both_precisions
@pytest.mark.parametrize("n_times", [1, 2, 256, 257, 1024, 1281, 100_000])
def test_surveys_agree_and_hold_the_running_sum_to_the_last_bit(
    compiled, rng, dtype, tolerance, n_times
):
    velocity = rng.standard_normal(n_times).astype(dtype)
    running = cumulative_trapezoid(velocity.astype(float), dx=1 / 48_000, initial=0)
    padded = np.pad(velocity.astype(float), (0, -n_times % 256), mode="edge").reshape(-1, 256)
    for module in (compiled, _kernels_numpy):
        angles, lowest, highest = module.survey(velocity, 0.5 / 48_000, 256)
        np.testing.assert_array_equal(angles, running[::256])
        np.testing.assert_array_equal(lowest, padded.min(axis=1))
        np.testing.assert_array_equal(highest, padded.max(axis=1))
        whole = module.integrate(velocity, 0.5 / 48_000, angles, 256)
        np.testing.assert_array_equal(whole, running)


@both_precisions
def test_integrals_agree_and_are_in_float64(compiled, rng, dtype, tolerance):
    velocity = rng.standard_normal(5000).astype(dtype)
    whole = velocity, 0.01, np.array([3.0]), len(velocity)
    one, other = (module.integrate(*whole) for module in (compiled, _kernels_numpy))
    assert one.dtype == other.dtype == np.float64
    assert one[0] == other[0] == 3.0
    agree(one, other)


@both_precisions
@pytest.mark.parametrize("n_signals", [1, 2, 5, 8, 11])
@pytest.mark.parametrize("scale", [3.0, -3.0])
@pytest.mark.parametrize("n_times", [1, 60, 10_000])  # several cells at a step, and many in a cell
def test_spreading_agrees(compiled, rng, dtype, tolerance, n_signals, scale, n_times):
    travel = np.sort(rng.uniform(0, 100, n_times))
    signals = [rng.standard_normal(n_times).astype(dtype) for _ in range(n_signals)]
    means = rng.standard_normal(n_signals)
    grids = np.zeros((2, n_signals, 290), dtype)  # the last samples lie beyond
    offset, ends = 2.5 if scale > 0 else 280.0, (-0.01, 100.01)
    for module, grid in zip((compiled, _kernels_numpy), grids, strict=True):
        module.spread(travel, ends, scale, offset, _kernel_halves(), signals, means, grid, 280)
    assert np.all(grids[:, :, 280:] == 0)
    assert np.abs(grids).max() > 0
    agree(grids[0], grids[1], tolerance)


@both_precisions
@pytest.mark.parametrize("factor", [2, 3, 7])
@pytest.mark.parametrize("beyond", [0, 1, 2])
@pytest.mark.parametrize("n_outputs", [1, 5, 400])
def test_upsampling_agrees(compiled, rng, dtype, tolerance, factor, beyond, n_outputs):
    signal = rng.standard_normal(40 + -(-n_outputs // factor)).astype(dtype)
    taps = np.hanning(32 * factor + 3)[1:-1]
    one, other = (
        module.upsample(signal, taps, factor, 16 * factor + beyond, n_outputs)
        for module in (compiled, _kernels_numpy)
    )
    assert one.dtype == other.dtype == dtype
    assert one.shape == (n_outputs,)
    agree(one, other, tolerance)


@both_precisions
def test_decimation_agrees_and_leaves_the_same_grid(compiled, rng, dtype, tolerance):
    grid = rng.standard_normal((3, 500)).astype(dtype)
    means = np.array([1.0, -2.0, 30.0])
    grids = [grid.copy(), grid.copy()]
    outputs = np.full((2, 3, 207), 7.0, dtype)
    for module, held, made in zip((compiled, _kernels_numpy), grids, outputs, strict=True):
        module.decimate(held, 480, 2, _decimating_filter(), means, made, 7)
    assert np.all(outputs[:, :, :7] == 7)
    agree(*outputs[:, :, 7:], tolerance)
    np.testing.assert_array_equal(grids[0], grids[1])
    np.testing.assert_array_equal(grids[0][:, :80], grid[:, 400:480])
    assert not grids[0][:, 80:480].any()


def test_decimation_is_a_convolution_of_which_every_other_point_is_kept(rng):
    grid, taps = rng.standard_normal(200), _decimating_filter()
    found = np.empty((1, 50))
    _kernels_numpy.decimate(grid[np.newaxis].copy(), 200, 3, taps, np.zeros(1), found, 0)
    found = found[0]
    np.testing.assert_allclose(found, np.convolve(grid, taps)[43 : 43 + 100 : 2], atol=1e-12)


@both_precisions
@pytest.mark.parametrize("n_signals", [1, 2, 5, 8, 11])
@pytest.mark.parametrize("shivers", [0.0, 2.0])
@pytest.mark.parametrize(("scale", "n_times"), [(0.05, 20_000), (0.6, 20_000), (0.6, 150)])
def test_resampling_agrees_and_leaves_the_same_grid(
    compiled, rng, dtype, tolerance, n_signals, shivers, scale, n_times
):
    used, lag = 30, 70.0 + scale * shivers
    travel = np.sort(rng.uniform(0, 1000, n_times)) + shivers * rng.uniform(0, 1, n_times)
    signals = [rng.standard_normal(n_times).astype(dtype) for _ in range(n_signals)]
    means, ends = rng.standard_normal(n_signals), (-0.01, 1000.01)
    started = rng.standard_normal((n_signals, used)).astype(dtype)
    n_outputs = int((scale * 1000 - lag) // 2) + 20  # more than are complete
    found = []
    for module in (compiled, _kernels_numpy):
        outputs = np.zeros((n_signals, max(0, n_outputs)), dtype)
        grid, n_points, n_done = module.resample(
            travel,
            ends,
            scale,
            22.0,
            _kernel_halves(),
            signals,
            means,
            started.copy(),
            used,
            2,
            _decimating_filter(),
            lag,
            outputs,
        )
        assert n_points == used or n_points == int(scale * travel.max() + 22) + 3 - 2 * n_done
        assert not grid[:, n_points:].any()
        found.append((n_done, n_points, outputs[:, :n_done], grid[:, :n_points]))
        assert not outputs[:, n_done:].any()
    assert found[0][:2] == found[1][:2]
    assert (found[0][0] > 0) == (scale > 0.05)
    for one, other in zip(found[0][2:], found[1][2:], strict=True):
        assert one.dtype == other.dtype == dtype
        if one.size:
            agree(one, other, tolerance)


def test_resampling_is_spreading_and_decimation(compiled, rng):
    travel, ends = np.linspace(0, 1000, 20_000), (-0.05, 1000.05)
    signal, means, taps = rng.standard_normal(20_000), np.array([3.0]), _decimating_filter()
    outputs = np.empty((1, 200))
    _, _, n_done = compiled.resample(
        travel,
        ends,
        0.6,
        22.0,
        _kernel_halves(),
        [signal],
        means,
        np.zeros((1, 0)),
        0,
        2,
        taps,
        65.0,
        outputs,
    )
    grid, expected = np.zeros((1, 700)), np.empty((1, 200))
    _kernels_numpy.spread(travel, ends, 0.6, 22.0, _kernel_halves(), [signal], means, grid, 700)
    _kernels_numpy.decimate(grid, 700, 2, taps, means, expected, 0)
    assert n_done == 200
    agree(outputs, expected)


@both_precisions
@pytest.mark.parametrize("n_signals", [1, 5, 9])
def test_reading_off_between_samples_agrees(compiled, rng, dtype, tolerance, n_signals):
    reached = np.maximum.accumulate(np.cumsum(rng.uniform(-0.2, 1, 30_000)))
    n_angles = int((reached[-1] - reached[0]) / 0.3)
    signals = [rng.standard_normal(30_000).astype(dtype) for _ in range(n_signals)]
    found = np.empty((2, n_signals, n_angles), dtype)
    for module, values in zip((compiled, _kernels_numpy), found, strict=True):
        left, shares = module.places(reached, 4, n_angles, 0.3, dtype)
        assert (left.dtype, shares.dtype) == (np.int32, dtype)
        module.read_off(reached, 4, 0.3, signals, values)
    agree(*found, tolerance)


def test_straight_lines_are_read_off_as_by_numpy_interp(rng):
    reached = np.cumsum(rng.uniform(0.1, 1, 500))
    signal = rng.standard_normal(500)
    values = np.empty((1, 400))
    _kernels_numpy.read_off(reached, 2, 0.5, [signal], values)
    expected = np.interp(0.5 * np.arange(2, 402), reached, signal)
    np.testing.assert_allclose(values[0], expected, atol=1e-12)


@both_precisions
@pytest.mark.parametrize("remove_mean", [True, False])
def test_windowed_segments_agree(compiled, rng, dtype, tolerance, remove_mean):
    signals = (rng.standard_normal((2, 1000)) + 5).astype(dtype)
    window = np.hanning(128).astype(dtype)
    one, other = (
        module.windowed(signals, 7, 50, window, 17, remove_mean)
        for module in (compiled, _kernels_numpy)
    )
    assert one.dtype == other.dtype == dtype
    assert one.shape == (2, 17, 128)
    agree(one, other, tolerance)


def in_pairs(segments):
    """Real and imaginary parts, and nothing beside a last one."""
    pairs = np.zeros((len(segments), -(-segments.shape[1] // 2), segments.shape[2]), complex)
    pairs += segments[:, ::2]
    pairs[:, : segments.shape[1] // 2] += 1j * segments[:, 1::2]
    return pairs


@both_precisions
@pytest.mark.parametrize("remove_mean", [True, False])
@pytest.mark.parametrize("n_segments", [1, 2, 17])
def test_segments_are_put_together_in_pairs(
    compiled, rng, dtype, tolerance, remove_mean, n_segments
):
    signals = (rng.standard_normal((2, 1000)) + 5).astype(dtype)
    cut = signals, 7, 50, np.hanning(128).astype(dtype), n_segments, remove_mean
    expected = in_pairs(_kernels_numpy.windowed(*cut))
    for module in (compiled, _kernels_numpy):
        pairs = module.paired(*cut)
        assert pairs.dtype == np.result_type(dtype, np.complex64)
        assert pairs.shape == expected.shape
        agree(pairs, expected, tolerance)


@both_precisions
@pytest.mark.parametrize("remove_mean", [True, False])
@pytest.mark.parametrize(("length", "n_taps"), [(32, 32), (64, 64), (132, 33), (4096, 64)])
def test_thinned_segments_agree(compiled, rng, dtype, tolerance, remove_mean, length, n_taps):
    signals = (rng.standard_normal((2, 3 * length)) + 5).astype(dtype)
    window, taps = np.hanning(length).astype(dtype), rng.standard_normal(n_taps).astype(dtype)
    one, other = (
        module.thinned(signals, 7, length // 3, window, 5, remove_mean, taps)
        for module in (compiled, _kernels_numpy)
    )
    assert one.dtype == other.dtype == np.result_type(dtype, np.complex64)
    assert one.shape == (2, 3, length // 4)
    assert not one[:, -1].imag.any()
    agree(one, other, tolerance)


def test_thinning_is_a_product_of_transforms_that_folds(rng):
    signal, taps = rng.standard_normal((1, 128)), rng.standard_normal(9)
    thinned = _kernels_numpy.thinned(signal, 0, 64, np.ones(64), 2, False, taps)
    product = fft.fft(signal[0, :64] + 1j * signal[0, 64:]) * fft.fft(taps, 64).conj()
    folded = product.reshape(4, 16).sum(axis=0) / 4
    np.testing.assert_allclose(fft.fft(thinned[0, 0]), folded, atol=1e-12)


@both_precisions
@pytest.mark.parametrize("n_lines", [1, 2, 32, 33])
@pytest.mark.parametrize("n_segments", [1, 9, 10])
def test_powers_of_pairs_are_those_of_their_segments(
    compiled, rng, dtype, tolerance, n_lines, n_segments
):
    segments = rng.standard_normal((2, n_segments, 64)).astype(dtype)
    expected = (np.abs(np.fft.rfft(segments)) ** 2).sum(axis=1)[:, :n_lines]
    transforms = fft.fft(in_pairs(segments)).astype(np.result_type(dtype, np.complex64))
    for module in (compiled, _kernels_numpy):
        found = module.pair_powers(transforms, n_lines)
        assert found.dtype == np.float64
        agree(found, expected, tolerance)


@both_precisions
def test_powers_agree_and_are_in_float64(compiled, rng, dtype, tolerance):
    lines = np.fft.rfft(rng.standard_normal((2, 9, 64))).astype(np.result_type(dtype, np.complex64))
    one, other = compiled.powers(lines), _kernels_numpy.powers(lines)
    assert one.dtype == other.dtype == np.float64
    assert one.shape == (2, 33)
    agree(one, other)


@both_precisions
@pytest.mark.parametrize("remove_mean", [True, False])
@pytest.mark.parametrize("at_once", [1, 4, 100])
@pytest.mark.parametrize("n_parts", [1, 2, 3, 4])
def test_powers_of_segments_split_by_a_prime_agree(
    compiled, rng, dtype, tolerance, remove_mean, at_once, n_parts
):
    signals = (rng.standard_normal((2, 200)) + 1).astype(dtype)
    length = 11 * n_parts
    window = rng.uniform(0.5, 1, length).astype(dtype)
    places = rng.permutation(length).reshape(n_parts, 11).astype(np.uint32)
    mix = rng.standard_normal((n_parts, n_parts)).astype(dtype)
    cosines, sines = rng.standard_normal((2, 6, 6)).astype(dtype)
    cut = signals, 2, 15, window, 10, remove_mean
    one, other = (
        module.split_powers(*cut, places, mix, cosines, sines, at_once)
        for module in (compiled, _kernels_numpy)
    )
    assert one.dtype == other.dtype == np.float64
    agree(one, other, tolerance)


def test_more_parts_than_are_compiled_for_are_refused(compiled, rng):
    places = np.arange(55, dtype=np.uint32).reshape(5, 11)
    cut = rng.standard_normal((1, 100)), 0, 20, np.ones(55), 2, True
    with pytest.raises(ValueError, match="four parts at most, got 5"):
        compiled.split_powers(*cut, places, np.eye(5), np.eye(6), np.eye(6), 1)


# Which of them are used


def test_both_modules_offer_the_same_loops(compiled):
    def offered(module):
        return {name for name in vars(module) if not name.startswith("_") and name.islower()}

    loops = {
        "survey",
        "integrate",
        "spread",
        "decimate",
        "resample",
        "reach",
        "places",
        "read_off",
        "windowed",
        "paired",
        "thinned",
        "powers",
        "pair_powers",
        "split_powers",
    }
    assert loops <= offered(compiled) & offered(_kernels_numpy)


def test_kernels_can_be_named_for_a_while():
    with _kernels.using("numpy"):
        assert _kernels.kernels() is _kernels_numpy
        with _kernels.using("numba"):
            assert _kernels.kernels().COMPILED
        assert _kernels.kernels() is _kernels_numpy


def test_unknown_kernels_are_refused():
    with (
        pytest.raises(ValueError, match="kernels must be one of 'numpy', 'numba'; got 'fortran'"),
        _kernels.using("fortran"),
    ):
        pass


def in_a_new_process(code, **environment):
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("name", ["numpy", "numba"])
def test_the_environment_chooses(name):
    code = "from emacm._kernels import kernels; print(kernels().__name__)"
    assert in_a_new_process(code, EMACM_KERNELS=name).stdout == f"emacm._kernels.{name}\n"


def test_an_unknown_choice_in_the_environment_is_refused():
    found = in_a_new_process("from emacm._kernels import kernels; kernels()", EMACM_KERNELS="c")
    assert "EMACM_KERNELS must be one of 'numpy', 'numba'; got 'c'" in found.stderr


def test_without_numba_its_kernels_name_the_extra():
    code = (
        "import sys; sys.modules['numba'] = None\n"
        "from emacm._kernels import kernels, using\n"
        "with using('numba'): pass"
    )
    assert "install emacm[fast]" in in_a_new_process(code).stderr


def test_numba_is_imported_only_when_something_is_resampled():
    code = (
        "import sys, emacm, numpy as np\n"
        "run = emacm.Recording({'a': np.ones(99)}, 10, velocity=np.ones(99))\n"
        "resampled = emacm.OrderResampler().fit_transform([run])\n"
        "assert 'numba' not in sys.modules\n"
        "resampled[0].strokes\n"
        "assert 'numba' in sys.modules"
    )
    found = in_a_new_process(code, EMACM_KERNELS="numba")
    assert found.returncode == 0, found.stderr
