"""A fitted pipeline as C99 sources: from samples over time to a decision, without a library."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from math import ceil, log2
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_choice, check_number
from emacm._saved import write_whole
from emacm._version import __version__
from emacm.export.exported_model import ExportedModel
from emacm.recordings.names import chosen_channels, printable
from emacm.resampling.spreading import (
    DESIGN,
    decimating_filter,
    kernel_halves,
    upsampling,
    upsampling_filter,
)
from emacm.shaft.motion import DIRECTIONS, longest_gap
from emacm.streams.order_monitor import OrderMonitor

# Speed in 16 sections of equal length, in 64ths of the highest: forward, at rest, and in reverse.
_SECTIONS = np.array([0, 20, 64, 61, 58, 55, 52, 48, 20, 0, -20, -64, -60, -56, -52, -48])


@dataclass(frozen=True)
class ExportedC:
    """What `export_c` wrote.

    Attributes
    ----------
    files : list of Path
        emacm_model.h, emacm_model.c, check.c and README.md.
    ram, constants : int
        Bytes of the state, and of the tables.
    operations : int
        Multiplications and additions for each sample of all channels, at the highest speed.
    longest : int
        Those of the longest call, in which a segment is complete.
    """

    files: list[Path]
    ram: int
    constants: int
    operations: int
    longest: int


def export_c(
    model: Any,
    folder: Path | str,
    *,
    fs: float,
    channels: Sequence[str] | None = None,
    max_speed: float | None = None,
    every: float | None = None,
    precision: str = "float32",
) -> ExportedC:
    """Write a fitted pipeline as C99 for the controller of a machine.

    The program takes one sample of each channel and the velocity of the shaft at a time. It
    computes what `OrderMonitor` does: angle, strokes, band-limited resampling, Welch's method over
    angle, bins, affine steps, posterior, typicality, unknown state, and the decision of least risk.
    It needs `math.h`, `stdint.h` and `string.h`, allocates nothing, and holds all in one struct.

    Parameters
    ----------
    model : estimator
        Fitted pipeline of `OrderResampler`, `OrderPSD`, `BinTransformer`, logarithms and affine
        steps (scaling, PCA), and `CostSensitiveGaussianBayes`.
    folder : path-like
        Where emacm_model.h, emacm_model.c, check.c (test vectors, with the decisions of Python) and
        README.md (interface, memory, operations) are written.
    fs : float
        Sampling rate of all channels and of the velocity [Hz].
    channels : sequence of str, optional
        Order of the channels of a sample. Default: that of the model.
    max_speed : float, optional
        Highest speed of the measured shaft [rad/s]; faster samples are rejected. Default: that of
        the training, and 10 % more.
    every : float, optional
        Revolutions of the shaft of interest after which a reading is complete, as for
        `OrderMonitor`; 0: only `emacm_finish` completes one. Default: those of the shortest
        recording of the training.
    precision : {"float32", "float64"}
        Numbers of the program: float or double.

    Returns
    -------
    ExportedC

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or a step cannot be exported; the message names it.

    See Also
    --------
    emacm.OrderMonitor : The same on a computer.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import numpy as np
    >>> from sklearn.pipeline import make_pipeline
    >>> from emacm import BinTransformer, CostSensitiveGaussianBayes, OrderPSD, OrderResampler
    >>> from emacm import Recording, export_c
    >>> rng = np.random.default_rng(0)
    >>> speed = np.full(8000, 90.0)
    >>> X = [Recording({"force": (1 + k % 2) * rng.normal(size=8000)}, 2000, velocity=speed)
    ...      for k in range(20)]
    >>> model = make_pipeline(OrderResampler(), OrderPSD(4), BinTransformer(max_order=2),
    ...                       CostSensitiveGaussianBayes()).fit(X, ["new", "worn"] * 10)
    >>> exported = export_c(model, mkdtemp(), fs=2000)
    >>> [file.name for file in exported.files], exported.ram < 65536
    (['emacm_model.h', 'emacm_model.c', 'check.c', 'README.md'], True)
    """
    chain = ExportedModel(model)
    check_number(fs, "fs", above=0, unit="Hz")
    check_choice(precision, "precision", ("float32", "float64"))
    names = chain.resampler.channels_
    order = chosen_channels(names if channels is None else channels, ())
    if sorted(order) != sorted(names):
        raise ValueError(f"channels must be those of the model, {list(names)}, got {order}.")
    ratio, ranges = chain.resampler.ratio, chain.resampler.training_range_.ranges
    speed = 1.1 * ranges["fastest"][1] / ratio if max_speed is None else max_speed
    check_number(speed, "max_speed", above=0, unit="rad/s")
    # As in the range of the training: lower valid orders count from 10 % on.
    supported = np.pi * fs / ranges["fastest"][1]
    used = (chain.bins.shape[1] - 1) * chain.psd.order_step_
    if 1.1 * supported < min(used, ranges["max_order"][0]):
        raise ValueError(
            f"fs = {fs:g} Hz holds orders up to {supported:.4g} at the highest speed of the "
            f"training, but the model uses orders up to {used:.4g}. Raise fs."
        )
    turns = ranges["revolutions"][0] if every is None else every
    check_number(turns, "every", at_least=0, unit="revolutions")
    stated = {"fs": float(fs), "max_speed": float(speed), "every": float(turns)}
    sizes = _sizes(chain, precision, fs, speed)
    as_text = _Numbers(precision)
    values = sizes | stated | as_text.words
    values |= {"version": __version__, "channels": printable(", ".join(order)).replace("/", " ")}
    tables = _tables(chain, [names.index(name) for name in order], sizes, fs) | as_text.limits
    tables |= _places(chain, sizes, precision, float(fs), float(turns))
    values["tables"] = "\n".join(as_text.declared(tables))
    values["stages"] = "\n".join(_stages(chain))
    values["classes"] = _labels(chain.classifier.classes_)
    values["decisions"] = _labels(chain.classifier.decisions_)
    check = _check_tables(chain, model, order, np.dtype(precision).type, stated)
    check["TOLERANCE"] = as_text.tolerance
    values["check_tables"] = "\n".join(as_text.declared(check))
    counted = _counted(chain, sizes, stated, tables, 4 if precision == "float32" else 8)
    values |= counted | {"ram_stack": 1024 + 64 * sizes["n_classes"]}
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    texts, written = {key: as_text(value) for key, value in values.items()}, []
    texts |= {f"plain_{key}": f"{value:.6g}" for key, value in stated.items()}
    for name in ("emacm_model.h", "emacm_model.c", "check.c", "README.md"):
        template = Template(files("emacm.export").joinpath(f"templates/{name}").read_text("utf-8"))
        write_whole(folder / name, template.substitute(texts).encode())
        written.append(folder / name)
    return ExportedC(written, **counted)


def _sizes(chain: ExportedModel, precision: str, fs: float, max_speed: float) -> dict[str, Any]:
    """Return the sizes of all arrays."""
    plan, resampler, classifier = chain.psd.plan_, chain.resampler, chain.classifier
    highest = resampler.ratio * max_speed * (1 + 1e-9)
    factor = upsampling(fs, highest, resampler.theta_s)
    if factor > 8:
        raise ValueError(
            f"OrderResampler would have to make the samples {factor} times as dense at "
            f"max_speed = {max_speed:.4g} rad/s; at most 8 times can be exported. Raise fs, lower "
            f"max_speed, or fit with a larger theta_s."
        )
    step = resampler.theta_s / 2
    # Only at standstill, or between denser samples, can the shaft turn back along a stroke.
    reversal = DESIGN.least_reversal / step if resampler.min_speed > 0 or factor > 1 else 0.0
    lag = 2 * reversal + DESIGN.margin + 2 * DESIGN.half + DESIGN.first + 1
    n_points = lag + DESIGN.margin + 8 + highest / (fs * step)
    width = max([len(chain.bins) * chain.n_blocks, *(len(s[-1]) for s in chain.stages if s[1:])])
    return {
        "n_channels": len(resampler.channels_),
        "n_rows": len(resampler.channels_) + 1,
        "n_kinds": 1 + plan.by_direction,
        "length": plan.n_per_segment,
        "step": plan.step,
        "n_lines": chain.bins.shape[1],
        "n_bins": len(chain.bins),
        "n_work": max(plan.n_per_segment, 2 * width),
        "n_features": classifier.n_features_in_,
        "n_classes": len(classifier.classes_),
        "n_truths": len(classifier.truths_),
        "n_decisions": len(classifier.decisions_),
        "n_densities": factor,
        "grid": 2 ** ceil(log2(n_points)),
        # Beyond a segment: what the shaft may creep at standstill before a stroke has ended.
        "ring": plan.n_per_segment + max(32, round(plan.samples_per_rev / 2)),
        "held": 4 if factor == 1 else 64,
        "tail": 128 if precision == "float32" else 2048,
        "lag": lag,
        "reversal": reversal,
    }


def _places(
    chain: ExportedModel, sizes: Mapping[str, Any], precision: str, fs: float, every: float
) -> dict[str, Any]:
    """Return the numbers that decide on angles and strokes; points are those of the fine grid."""
    resampler, step = chain.resampler, chain.resampler.theta_s / 2
    total = every * (1 - 1e-12) * 4 * np.pi * fs / resampler.ratio  # of two velocities each
    limit = float(np.dtype(precision).type(total))
    return {
        "MARGIN": DESIGN.margin,
        "FIRST": DESIGN.first,
        "HALF": DESIGN.half,
        "REACH": DESIGN.upsampling_half,
        "MEAN_OF": np.uint32(DESIGN.mean_of),
        "DETREND": int(bool(chain.psd.plan_.detrend)),
        "STEP": sizes["step"],
        "DELAY": 0 if sizes["n_densities"] == 1 else DESIGN.upsampling_half - 1,
        "POINTS": resampler.ratio / (2 * fs * step),  # for the sum of two velocities
        "LAG": sizes["lag"],
        "TAIL_RANGE": sizes["reversal"] + DESIGN.margin + 3,
        "LIMIT": limit,  # of the sums of a reading
        "LIMIT_REST": total - limit,
        "MIN_SPEED": float(resampler.min_speed),
        "MAX_GAP": np.uint32(min(longest_gap(resampler.max_rest, fs), 2**32 - 1)),
        "MAX_REVERSAL": DESIGN.least_reversal / step,
        # Whether forward and reverse strokes are resampled.
        "TURNS": np.array([sign in DIRECTIONS[resampler.direction] for sign in (1, -1)], int),
    }


def _tables(
    chain: ExportedModel, order: Sequence[int], sizes: Mapping[str, Any], fs: float
) -> dict[str, Any]:
    """Return the constants of the program."""
    plan, resampler = chain.psd.plan_, chain.resampler
    turn = 2 * np.pi * np.arange(plan.n_per_segment) / plan.n_per_segment
    numbers = np.arange(plan.n_per_segment // 2, dtype=np.uint32)
    factors = np.arange(1, sizes["n_densities"] + 1)
    # As `upsampling`: up to which speed the samples of a density are dense enough.
    dense = np.where(factors == 1, 0.5, factors - 0.58)
    speeds = dense * fs * 2 * resampler.theta_s / (4 - DESIGN.flat) / resampler.ratio
    speeds[-1] = 1e30
    lines, bins = np.nonzero(chain.bins.T)
    taps = np.zeros((len(factors), 2 * DESIGN.upsampling_half * len(factors) + 1))
    for row, factor in zip(taps[1:], factors[1:].tolist(), strict=True):
        row[: 2 * DESIGN.upsampling_half * factor + 1] = upsampling_filter(factor)
    known = chain.typicality()
    tables = {
        "LARGEST_RADIX": max(chain.radices),
        "HAS_TYPICALITY": int(bool(known)),
        "ORDER": np.argsort(order),
        "COSINE": np.cos(turn),
        "SINE": np.sin(turn),
        "WINDOW": plan.weights,
        "RADICES": np.array(chain.radices, np.uint32),
        "N_RADICES": len(chain.radices),
        # Where each number has to be before it is transformed in place.
        "PLACES": numbers.reshape(chain.radices[::-1]).T.ravel(),
        "TAPS": decimating_filter()[: DESIGN.half + 1],
        "KERNEL": kernel_halves(),
        "UPSAMPLING": taps,
        "SPEEDS": speeds,
        "BIN_FROM": np.searchsorted(lines, np.arange(sizes["n_lines"] + 1)).astype(np.uint32),
        "BIN_OF": bins,
        "BIN_WEIGHT": chain.bins[bins, lines],
        **chain.gaussians(),
        **known,
    }
    for k, stage in enumerate(chain.stages):
        if stage[1:]:
            tables[f"MATRIX_{k}"], tables[f"CONSTANT_{k}"] = stage
    return tables


def _stages(chain: ExportedModel) -> Iterable[str]:
    """Yield the lines of the program between the bins and the classifier."""
    for k, stage in enumerate(chain.stages):
        loop, size = "    for (i = 0; i < n; i++)", len(stage[-1])
        if not stage[1:]:
            yield f"{loop} {{\n        if (!(z[i] > 0))\n            s->flags |= EMACM_NO_POWER;"
            yield f"        z[i] = MATH({stage[0]})(z[i]);\n    }}"
            yield "    if (s->flags & EMACM_NO_POWER)\n        return -1;"
        elif stage[0].ndim == 1:
            yield f"{loop}\n        z[i] = z[i] * MATRIX_{k}[i] + CONSTANT_{k}[i];"
        else:
            yield f"    for (k = 0; k < {size}; k++) {{\n        z[n + k] = CONSTANT_{k}[k];"
            yield f"    {loop}\n            z[n + k] += z[i] * MATRIX_{k}[k][i];\n    }}"
            yield f"    memmove(z, z + n, {size} * sizeof *z);\n    n = {size};"


def _counted(
    chain: ExportedModel,
    n: Mapping[str, Any],
    stated: Mapping[str, float],
    tables: Mapping[str, Any],
    size: int,
) -> dict[str, int]:
    """Return bytes of memory, and counts of multiplications and additions.

    The state as the header declares it; the steps as the program carries them out.
    """
    rows, channels, blocks = n["n_rows"], n["n_channels"], n["n_channels"] * n["n_bins"]
    density = rows * n["grid"] + n["tail"] * (1 + rows) + 2 * blocks + n["n_bins"] + 7
    stroke = n["n_densities"] * (density * size + 16) + (2 * channels + 3) * size + 8
    numbers = n["n_densities"] * rows * n["ring"] + n["n_work"] + 2 * n["n_lines"]
    numbers += blocks * n["n_kinds"] + n["held"] * (2 * channels + 1) + 3
    numbers += n["n_features"] + n["n_classes"] + n["n_decisions"] + 2
    ram = 2 * stroke + numbers * size + 4 * (n["n_kinds"] + 10)
    constants = sum(size * np.size(value) for value in tables.values() if np.ndim(value))
    points = 2 * chain.resampler.ratio * stated["max_speed"] / stated["fs"]
    outputs = points / (2 * chain.resampler.theta_s)  # of each sample
    each, output = 30 + 13 * rows, rows * 3 * DESIGN.half
    stages = sum(8 if radix == 2 else 6 + 8 * radix for radix in chain.radices)
    segment = rows * (n["length"] * (3 + stages / 2) + n["n_lines"] * 24)
    made = (2 * DESIGN.upsampling_half + 1) * (2 * channels + 1)  # a sample between two others
    dense = sum(factor * (each + made * (factor > 1)) for factor in range(1, n["n_densities"] + 1))
    average = dense + n["n_densities"] * outputs * (output + segment / n["step"])
    longest = average + n["n_densities"] * segment
    counted = {"ram": ram, "constants": constants, "operations": average, "longest": longest}
    return {name: int(value) for name, value in counted.items()}


class _Numbers:
    """Numbers as C writes them.

    Parameters
    ----------
    precision : {"float32", "float64"}
    """

    def __init__(self, precision: str) -> None:
        self._single = precision == "float32"
        self.words = {
            "real": "float" if self._single else "double",
            "math": "name##f" if self._single else "name",
        }
        self.tolerance = 1e-3 if self._single else 1e-9  # of a feature
        number = np.finfo(precision)
        self.limits = {
            "ROUNDING": 1e-6 if self._single else 1e-9,
            "TIED": 1e-6 if self._single else 1e-12,
            "LARGEST": float(number.max) / 4,
            "SMALLEST": float(number.tiny),
            "SERIES": 1e-2 if self._single else 1e-4,
        }

    def __call__(self, value: Any) -> str:
        """Return a number, or a text as it is."""
        if isinstance(value, str | int | np.integer):
            return f"{value}{'u' * isinstance(value, np.unsignedinteger)}"
        if np.isinf(value):
            return "INFINITY" if value > 0 else "-INFINITY"
        text = f"{value:.9g}" if self._single else repr(float(value))
        text = text if set(text) & set(".en") else f"{text}.0"
        return text + "f" * self._single

    def declared(self, tables: Mapping[str, Any]) -> Iterable[str]:
        """Yield the declarations of arrays, and single numbers as macros."""
        for name, value in tables.items():
            array = np.asarray(value)
            if array.ndim == 0:
                yield f"#define {name} {self(array[()])}"
                continue
            kind = {"i": "int32_t", "u": "uint32_t"}.get(array.dtype.kind, "emacm_real")
            sizes = "".join(f"[{n}]" for n in array.shape)
            listed = np.array2string(
                array, separator=", ", threshold=array.size, formatter={"all": self}
            )
            braces = listed.replace("[", "{").replace("]", "}")
            yield f"static const {kind} {name}{sizes} = {braces};"


def _labels(labels: Any) -> str:
    """Return labels as strings of C, in UTF-8."""
    return ", ".join(json.dumps(str(label), ensure_ascii=False) for label in labels.tolist())


def _check_tables(
    chain: ExportedModel, model: Any, channels: Sequence[str], dtype: Any, stated: dict[str, float]
) -> dict[str, Any]:
    """Return what check.c makes twelve recordings of, and the readings of Python.

    Noise comes from a linear congruential generator, speeds are whole multiples of a number: the
    samples are the same, bit for bit, on any computer. Levels and speeds are within those of the
    training, but for one level in three, which is twice as large.

    Parameters
    ----------
    chain : ExportedModel
        The steps of the model.
    model : estimator
        Fitted pipeline.
    channels : sequence of str
        In the order of a sample.
    dtype : type
        Numbers of the samples.
    stated : dict of str to float
        "fs", "max_speed" and "every", as for `export_c`.

    Returns
    -------
    dict
    """
    fs, max_speed, every = stated.values()
    monitor = OrderMonitor(
        model, fs=fs, channels=channels, max_speed=max_speed, every=every or None
    )
    ranges, ratio = chain.resampler.training_range_.ranges, chain.resampler.ratio
    rng = np.random.default_rng(12)
    levels, speeds, sizes, readings = [], [], [], []
    for number in range(12):
        low, high = np.array([ranges[f"level of {name}"] for name in channels]).T
        level = low * (high / np.maximum(low, 1e-30)) ** rng.uniform(size=len(channels))
        level *= 2 if number % 3 == 2 else 1
        slowest, fastest = ranges["fastest"]
        speed = min(rng.uniform(slowest, fastest) / ratio, 0.999 * max_speed)
        turns = every or ranges["revolutions"][0]
        size = int(2 * turns * 2 * np.pi / ratio / speed * fs) + 64
        levels.append((level * np.sqrt(3) / 2**23).astype(dtype))
        speeds.append(dtype(speed / 64))
        sizes.append(size)
        noise = _noise(number + 1, size * len(channels)).reshape(size, -1)
        signals = (noise.astype(dtype) * levels[-1]).T
        velocity = _SECTIONS.astype(dtype)[16 * np.arange(size) // size] * speeds[-1]
        found = monitor.push(signals, velocity=velocity)
        readings.append([*found, *monitor.flush(complete=True)][0])
    decisions = chain.classifier.decisions_.tolist()
    n_features = chain.classifier.n_features_in_
    return {
        "N_READINGS": len(readings),
        "N_SAMPLES": np.array(sizes, np.uint32),
        "LEVEL": np.array(levels),
        "SPEED": np.array(speeds),
        "SECTIONS": _SECTIONS,
        "DECISION": np.array(
            [-1 if r.decision is None else decisions.index(r.decision) for r in readings]
        ),
        "FEATURES": np.array(
            [np.zeros(n_features) if r.features is None else r.features for r in readings]
        ),
        "TYPICALITY": np.array([-1.0 if r.typicality is None else r.typicality for r in readings]),
    }


def _noise(seed: int, size: int) -> NDArray[np.int32]:
    """Return whole numbers of 24 bits, of the generator of Numerical Recipes."""
    powers = np.full(size, 1664525, np.uint32).cumprod(dtype=np.uint32)
    sums = np.append(np.uint32(1), powers[:-1]).cumsum(dtype=np.uint32)
    state: Any = powers * np.uint32(seed) + np.uint32(1013904223) * sums
    return (state >> 8).astype(np.int32) - 2**23
