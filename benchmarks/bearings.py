"""Bearing faults on real machines: left-out fault sizes, another machine, and no training at all.

Recordings of the CWRU test rig (drive end and fan end, faulty only) and of the MFPT rig (also
healthy) are read below EMACM_DATA; without them, the benchmark says so. Three classes:
inner ring, outer ring, ball; balanced accuracy.

- "sizes left out": drive end, trained on two of the fault sizes 7, 14 and 21, tested on the third
  (and on 28), in turn. Loads are never split, since they share a bearing.
- "to the fan end": trained on the drive end, tested on the bearing at the other end.
- "from geometry alone": what `find_faults` names and suspects (CWRU: sizes 7, 14 and 21).

All choices and thresholds of `bearing_recipe` and `find_faults` were made on the drive end, on MFPT
and on simulated machines; the fan end and UESTC were evaluated only. The fan end was evaluated by
earlier versions of this script with no choice changed because of it: four times, five times when
prewhitening was computed in another way, and several times when the limits of `find_faults` for
several faults were chosen, where UESTC was printed too: there, the background in long segments was
narrowed after outer rings of UESTC had been given a second fault. That a further fault must reach
the limits of a first one was decided after false balls at both ends of CWRU had been seen (two of
34 and two of 23 names), with no limit chosen for it. That sidebands explain lines only where most
of them stand out, and the spectrum of 50 revolutions, were chosen on simulated bearings of other
seeds than those printed; no name of CWRU or MFPT changed. That this spectrum names nothing that
only the finer one tells from harmonics of the shaft follows a false ball of UESTC. That bearings
below 6 dB are only suspected, where no healthy recording has the load or speed, follows six wrong
rings of UESTC, compared with healthy recordings of one other speed; the limit is that of naming.

- "right", "wrong": faulty recordings with the exact name, or another one; "suspected": neither, but
  the right fault is suspected; "alarms": healthy recordings of which a fault is named.
- "SciPy": thirty lines (whitening of all lines, squared envelope, periodogram, mean of three
  harmonics over the median of half an order on either side), at the threshold in dB at which right
  minus wrong names and false alarms is largest over all recordings: at its best.
- UESTC is evaluated at its nominal speeds, which are wrong by -2.5 to 8 %, and at the speed of the
  comb of 1x to 6x in the signal.
- "speeds multiplied": all rigs, UESTC by its comb; "stated": the explanation asks for a speed
  within 1.5 % of the right one (labels of CWRU are wrong by up to 1.5 %). That small errors are
  corrected, and how, was decided on all rigs at wrong speeds; at the right ones no name changed.

- "gear rig": that sidebands are compared harmonic by harmonic was chosen among about twelve
  measures after looking at these recordings; the limit of 3 dB is that of bearings.

Results (left-out sizes, to the fan end): `bearing_recipe` 0.95, 0.85; kurtogram 0.85, 0.74;
Welch 0.50, 0.37; MiniRocket (aeon 1.6) 0.50, 0.35; statistics 0.33, 0.55. The 95 % intervals are
about +-0.15, since there are two or three bearings of each class.

    python benchmarks/bearings.py [--quick] [--json [FILE]]
"""

from __future__ import annotations

import argparse
import itertools
import os
import warnings
from collections import Counter
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from measure import header, json_option, table, write_json
from numpy.typing import NDArray
from scipy import signal, stats
from sklearn.base import clone
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.ensemble import RandomForestClassifier
from sklearn.metrics import balanced_accuracy_score
from sklearn.pipeline import make_pipeline
from threadpoolctl import threadpool_limits

from emacm import (
    Bearing,
    CostSensitiveGaussianBayes,
    FaultLines,
    Gear,
    OrderPSD,
    OrderResampler,
    Recording,
    bearing_recipe,
    fault_orders,
    find_faults,
    kurtogram,
)
from emacm.machine.fault_spectra import healthy_scores

BEARINGS = {"DE12": Bearing(9, 7.94, 39.04), "FE": Bearing(8, 6.746, 28.499)}  # 6205, 6203
MFPT = Bearing(8, 0.235, 1.245)
SIMULATED = {"6205": BEARINGS["DE12"], "6203": BEARINGS["FE"], "MFPT": MFPT}
SIMULATED |= {"gear 23:67": Gear(23, 67), "gear 20:50": Gear(20, 50)}
UESTC = Bearing(8, 7.938, 33.5)  # UC204, from its lines
FAULTS = {"B": "BSF", "IR": "BPFI", "OR": "BPFO"}
RINGS = ("BPFI", "BPFO")
SIZES = (7, 14, 21)
SPEEDS = ("1797", "1772", "1750", "1730")
OTHERS = ("0.37", "0.5", "2.5", "1")  # impacts per revolution, as of a belt or a loose part
RATE = 12_000
CHANNEL = "casing"
Runs = list[Recording]


def read_cwru(folder: Path, end: str, every: int = 1) -> Runs:
    """Return the recordings of one end at every n-th speed, each with its fault and size."""
    runs = []
    with np.load(folder / "cwru_faults_12k.npz") as stored:
        for key in stored.files:
            rpm, kind, size, place = key.split("_")
            if place != end or rpm not in SPEEDS[::every]:
                continue
            meta = {"fault": FAULTS[kind.partition("@")[0]], "size": int(size)}
            meta |= {"place": kind, "rpm": int(rpm)}
            velocity = 2 * np.pi * float(rpm) / 60
            signals = {CHANNEL: stored[key].ravel()}
            runs.append(Recording(signals, RATE, velocity=velocity, meta=meta))
    return runs


def read_mfpt(folder: Path) -> Runs:
    """Return the recordings of the MFPT rig; those without fault are "none"."""
    kinds = {"b": "none", "O": "BPFO", "I": "BPFI"}
    with np.load(folder / "mfpt_train.npz") as stored:
        return [
            Recording(
                {CHANNEL: stored[f"{name}/gs"].ravel()},
                float(stored[f"{name}/fs"]),
                velocity=2 * np.pi * float(stored[f"{name}/rate"]),
                meta={"fault": kinds[name[0]]},
            )
            for name in sorted({key.partition("/")[0] for key in stored.files})
        ]


def faults_of(runs: Runs) -> NDArray[Any]:
    """Return the true fault of each recording."""
    return np.array([run.meta["fault"] for run in runs])


# Features: functions of recordings and of their bearing


def of_recipe(runs: Runs, bearing: Bearing) -> NDArray[np.floating]:
    """Return the levels of the three faults by `bearing_recipe`; they need no training."""
    levels = bearing_recipe(bearing).set_output(transform="pandas").fit_transform(runs)
    return levels[[f"{CHANNEL}@{fault}" for fault in FAULTS.values()]].to_numpy()


def of_kurtogram(runs: Runs, bearing: Bearing) -> NDArray[np.floating]:
    """Return the levels in the squared envelope of the band of the kurtogram, by SciPy."""
    rows = []
    for run in runs:
        low, high = kurtogram(run.signals[CHANNEL], RATE).band
        top = RATE / 2
        edges = max(low, 1.0), min(high, top - 1)
        sections = signal.butter(4, edges, "bandpass", fs=RATE, output="sos")
        passed = signal.sosfiltfilt(sections, run.signals[CHANNEL])
        squared = np.abs(signal.hilbert(passed)) ** 2
        rows.append(Recording({CHANNEL: squared}, RATE, velocity=run.velocity))
    chain = make_pipeline(
        OrderResampler(2 * np.pi / 64), OrderPSD(25, max_order=20), FaultLines(bearing)
    ).set_output(transform="pandas")
    return chain.fit_transform(rows)[[f"{CHANNEL}@{fault}" for fault in FAULTS.values()]].to_numpy()


def of_statistics(runs: Runs, bearing: Bearing) -> NDArray[np.floating]:
    """Return statistics of the signal over time."""
    found = []
    for run in runs:
        x = run.signals[CHANNEL]
        peak, rms = np.abs(x).max(), x.std()
        found.append(
            [rms, peak, peak / rms, stats.skew(x), stats.kurtosis(x), rms / np.abs(x).mean()]
        )
    return np.array(found)


def of_welch(runs: Runs, bearing: Bearing) -> NDArray[np.floating]:
    """Return the logarithm of the power spectral density in Hz."""
    psd = [signal.welch(run.signals[CHANNEL], RATE, nperseg=1024)[1] for run in runs]
    return np.log10(psd)


def of_samples(runs: Runs, bearing: Bearing) -> NDArray[np.floating]:
    """Return the first second of each signal."""
    return np.array([run.signals[CHANNEL][None, :RATE] for run in runs], np.float64)


def methods(n_trees: int) -> dict[str, tuple[Callable[..., Any], Any]]:
    """Return features and classifier of each method."""
    discriminant = LinearDiscriminantAnalysis(solver="lsqr", shrinkage="auto")
    uniform = CostSensitiveGaussianBayes(covariance="tied", priors="uniform", shrinkage="auto")
    found: dict[str, tuple[Callable[..., Any], Any]] = {
        "bearing_recipe": (of_recipe, uniform),
        "kurtogram, SciPy": (of_kurtogram, uniform),
        "statistics, random forest": (
            of_statistics,
            RandomForestClassifier(n_trees, class_weight="balanced", random_state=0),
        ),
        "Welch, LDA": (of_welch, discriminant),
    }
    if find_spec("aeon"):
        from aeon.classification.convolution_based import MiniRocketClassifier

        found["MiniRocket"] = (of_samples, MiniRocketClassifier(random_state=0))
    else:
        found["MiniRocket (aeon is not installed)"] = (of_samples, None)
    return found


def left_out_sizes(X: NDArray[Any], y: NDArray[Any], sizes: NDArray[Any], classifier: Any) -> float:
    """Return the balanced accuracy on sizes that were left out; 28 is left out with 21."""
    predicted = np.empty(len(y), object)
    for size in SIZES:
        test = (sizes == size) | ((size == SIZES[-1]) & (sizes > size))
        train = (sizes != size) & (sizes <= SIZES[-1])
        predicted[test] = clone(classifier).fit(X[train], y[train]).predict(X[test])
    return float(balanced_accuracy_score(y, predicted.astype(str)))


def accuracy(drive: Runs, fan: Runs, n_trees: int) -> list[dict[str, Any]]:
    """Return the rows of the methods that are trained."""
    kept = [run for run in drive if run.meta["size"] in SIZES]
    sizes = np.array([run.meta["size"] for run in kept])
    y, of_fan = faults_of(kept), faults_of(fan)
    rows = []
    for name, (features, classifier) in methods(n_trees).items():
        row: dict[str, Any] = {"method": name}
        rows.append(row)
        if classifier is None:
            continue
        X = features(kept, BEARINGS["DE12"])
        row["sizes left out"] = left_out_sizes(X, y, sizes, classifier)
        fitted = clone(classifier).fit(X, y)
        predicted = fitted.predict(features(fan, BEARINGS["FE"]))
        row["to the fan end"] = float(balanced_accuracy_score(of_fan, predicted))
    return rows


def read_uestc(folder: Path, every: int) -> tuple[Runs, Runs]:
    """Return the recordings of UESTC at their nominal speeds, and at those of their combs."""
    kinds = {"N": "none", "I": "BPFI", "O": "BPFO", "B": "BSF"}
    nominal, combed = [], []
    with np.load(folder / "uestc.npz") as stored:
        for key in stored.files[::every]:
            kind, rpm, _ = key.split("_")
            x, speed, meta = stored[key].ravel(), float(rpm) / 60, {"fault": kinds[kind]}
            for runs, rate in ((nominal, speed), (combed, comb_speed(x, 20_000.0, speed))):
                velocity = 2 * np.pi * rate
                runs.append(Recording({CHANNEL: x}, 20_000, velocity=velocity, meta=meta))
    return nominal, combed


def comb_speed(
    x: NDArray[np.floating],
    fs: float,
    near: float,
    *,
    limits: tuple[float, float] = (0.9, 1.12),
    n_orders: int = 6,
) -> float:
    """Return the speed [Hz] at which the lines 1x, 2x, ... are highest, by default 1x to 6x."""
    n = 4 * len(x)
    power = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(len(x)), n)) ** 2
    levels = np.log10(power[: int((n_orders + 2) * near / fs * n)] + 1e-30)
    speeds = near * np.linspace(*limits, 2201)
    lines = np.rint(np.outer(speeds, np.arange(1, n_orders + 1)) * n / fs).astype(int)
    return float(speeds[levels[lines].sum(axis=1).argmax()])


def scipy_scores(run: Recording, bearing: Bearing) -> dict[str, float]:
    """Return the level of each fault by thirty lines of SciPy [dB]."""
    x, fs = run.signals[CHANNEL].astype(float), run.fs[CHANNEL]
    spectrum = np.fft.rfft(x)
    white = np.fft.irfft(spectrum / np.maximum(np.abs(spectrum), 1e-12 * np.abs(spectrum).max()))
    envelope = np.abs(signal.hilbert(white)) ** 2
    power = signal.periodogram(envelope, fs, "hann")[1]
    step = fs / len(envelope) / (run.velocity.mean() / (2 * np.pi))  # orders
    half = round(0.5 / step)
    found = {}
    for line in fault_orders(bearing).itertuples():
        if line.Index not in FAULTS.values():
            continue
        order = line.order * (2 if line.Index == "BSF" else 1)
        levels = []
        for slipped in order * np.linspace(0.98, 1.02, 41):
            places = [round(k * slipped / step) for k in (1, 2, 3)]
            heights = [
                power[p - 1 : p + 2].max() / np.median(power[p - half : p + half]) for p in places
            ]
            levels.append(np.mean(10 * np.log10(heights)))
        found[line.Index] = max(levels)
    return found


def is_named(named: Any) -> NDArray[np.bool_]:
    """Return whether each name is that of a fault."""
    return ~np.isin(named, ("none", "not assessed"))


def outcomes(truth: NDArray[Any], named: NDArray[Any]) -> dict[str, int]:
    """Return the numbers of right and wrong names, and of false alarms."""
    is_faulty = truth != "none"
    right = is_faulty & (named == truth)
    return {
        "right": int(right.sum()),
        "wrong": int((is_faulty & is_named(named) & ~right).sum()),
        "alarms": int((~is_faulty & is_named(named)).sum()),
    }


def named_by_rig(rigs: dict[str, tuple[Runs, Bearing]]) -> list[dict[str, Any]]:
    """Count the recordings that are named correctly without training, beside SciPy; and print."""
    truths = {rig: faults_of(runs) for rig, (runs, _) in rigs.items()}
    scores = {
        rig: [scipy_scores(run, bearing) for run in runs] for rig, (runs, bearing) in rigs.items()
    }

    def by_scipy(rig: str, limit: float) -> NDArray[Any]:
        best = [max(found, key=found.__getitem__) for found in scores[rig]]
        highest = [max(found.values()) for found in scores[rig]]
        return np.where(np.array(highest) >= limit, best, "none")

    def gain(limit: float) -> int:
        rows = [outcomes(truth, by_scipy(rig, limit)) for rig, truth in truths.items()]
        return sum(row["right"] - row["wrong"] - row["alarms"] for row in rows)

    limit = max(np.arange(6.0, 25.0, 0.5), key=gain)
    rows = []
    for rig, (runs, bearing) in rigs.items():
        found, truth = find_faults(runs, bearing), truths[rig]
        named, suspected = found["named"].to_numpy(), found["suspected"].to_numpy()
        row = {"recordings": rig, "faulty": int((truth != "none").sum())}
        row |= outcomes(truth, named)
        row["suspected"] = int(((suspected == truth) & (truth != "none")).sum())
        row["not assessed"] = int((named == "not assessed").sum())
        row["healthy"] = int((truth == "none").sum())
        for name, chosen in {"rings": np.isin(truth, RINGS), "balls": truth == "BSF"}.items():
            row |= {name: int(chosen.sum()), f"{name} named": int((named == truth)[chosen].sum())}
            row[f"{name} suspected"] = int((suspected == truth)[chosen].sum())
        row |= {
            f"SciPy {name}": value for name, value in outcomes(truth, by_scipy(rig, limit)).items()
        }
        rows.append(row)
    print(f"\nfrom geometry alone; SciPy from {limit:g} dB on")
    print(table(rows))
    each = [row for row in rows if row["recordings"] != "UESTC, nominal"]
    numbers = [name for name in rows[0] if name != "recordings"]
    total = {name: sum(row[name] for row in each) for name in numbers}
    return [*rows, {"recordings": "all, UESTC by comb", **total}]


def wrong_speeds(rigs: dict[str, tuple[Runs, Bearing]], every: int) -> list[dict[str, Any]]:
    """Count what is named if the stated speeds are wrong, over all rigs, and print it."""
    rows = []
    factors = (0.92, 0.94, 0.96, 0.97, 0.98, 0.99, 1.01, 1.02, 1.03, 1.04, 1.06, 1.08)
    for factor in factors[::every]:
        row: Counter[str] = Counter()
        for runs, bearing in rigs.values():
            stated = [
                Recording(run.signals, run.fs, velocity=factor * run.velocity) for run in runs
            ]
            found, truth = find_faults(stated, bearing), faults_of(runs)
            named = found["named"].to_numpy()
            asked = found["explanation"].str.extract(r"is the speed (\d+) rpm")[0].astype(float)
            true = np.array([run.velocity.mean() * 30 / np.pi for run in runs])
            row.update({"recordings": len(runs)} | outcomes(truth, named))
            row["not assessed"] += int((named == "not assessed").sum())
            row["stated"] += int((np.abs(asked / true - 1) < 0.015).sum())
        rows.append({"speeds multiplied": factor, **row})
    print("\nwrong speeds")
    print(table(rows))
    return rows


def without_answer(runs: Runs, bearing: Bearing) -> dict[str, float]:
    """Return the share of recordings, made unusable, that are refused or "not assessed"."""

    def samples(change: Callable[[NDArray[Any]], NDArray[Any]]) -> Callable[..., Recording]:
        return lambda run: Recording(
            {CHANNEL: change(run.signals[CHANNEL])}, run.fs, velocity=run.velocity
        )

    changes: dict[str, Callable[[Recording], Recording]] = {
        "zeros": samples(lambda x: 0 * x),
        "constant": samples(lambda x: 0 * x + 2.5),
        "three quarters zeros": samples(lambda x: np.where(np.arange(len(x)) < len(x) / 4, x, 0)),
        "clipped": samples(lambda x: np.clip(x, *np.percentile(x, (5, 95)))),
        "three values": samples(lambda x: np.sign(x) * (np.abs(x) > x.std())),
        "8 revolutions": lambda run: run.cut(0, 8 * 2 * np.pi / run.velocity.mean()),
    }

    def is_refused(run: Recording) -> bool:
        try:
            return find_faults([run], bearing)["named"][0] == "not assessed"
        except ValueError:
            return True

    return {
        name: float(np.mean([is_refused(change(run)) for run in runs]))
        for name, change in changes.items()
    }


# A gear rig


def gear_rig(folder: Path, every: int) -> list[dict[str, Any]]:
    """Count recordings of a gear rig (32:80) with a gear named in at least one channel.

    Each healthy recording is left out of its own baseline. One gearbox stands for each state.
    """
    pair, runs = Gear(32, 80), []
    with np.load(folder / "gear_rig_loads_0-80.npz") as stored:
        for name in stored.files[1::2]:
            state, load = name.split("_")
            signals = dict(zip("abcd", stored[name].T.astype(float), strict=True))
            velocity = 2 * np.pi * float(stored[f"{name}/shaft_hz"])
            meta = {"state": state, "load": int(load)}
            runs.append(Recording(signals, 12_800, velocity=velocity, meta=meta))
    rows = []
    for state in ("healthy", "broken"):
        chosen = [run for run in runs if run.meta["state"] == state][::every]
        row: dict[str, Any] = {"gear rig": state, "recordings": len(chosen)}
        without, named = find_faults(chosen, pair), []
        for run in chosen:
            others = [r for r in runs if r.meta["state"] == "healthy" and r is not run]
            named.append(is_named(find_faults([run], pair, healthy=others)["named"]))
        row |= {"named": sum(each.any() for each in named), "channels named": int(np.sum(named))}
        row["channels suspected without healthy"] = int((without["suspected"] != "none").sum())
        rows.append(row)
    return rows


# Several faults


def damaged(part: Bearing | Gear, sizes: dict[str, float], seed: int) -> Recording:
    """Return a simulated part with some faults: struck resonances under noise, 6 s at 20 kHz.

    A number as the name of a fault is the order of impacts that are not of the part. A gear has
    three harmonics of its mesh, which both shafts modulate.
    """
    rng, fs, length = np.random.default_rng(seed), 20_000, 120_000
    rate = rng.choice([20.0, 25.0, 30.0, 35.0])
    lines = {line.name: line for line in part.lines()}
    x = 0.12 * rng.standard_normal(length)
    for name, size in sizes.items():
        slips = name in lines and lines[name].slips
        order = lines[name].order * lines[name].strikes if name in lines else float(name)
        struck = order * rate * (1 + (rng.uniform(-0.012, 0.005) if slips else 0.0))
        scatter = 0.0 if name in lines and not slips else 0.01
        times = np.cumsum((1 + scatter * rng.standard_normal(int(7 * struck))) / struck)
        times = times[times < 5.9]
        turn = {"BPFI": rate, "BSF": rate * lines["FTF"].order}.get(name) if slips else None
        load = (
            1.0 if turn is None else np.clip(0.55 + 0.75 * np.cos(2 * np.pi * turn * times), 0, 1)
        )
        hits = np.bincount((times * fs).astype(int), size * load * np.ones(len(times)), length)
        w = 2 * np.pi * rng.uniform(2000, 7000) / fs * np.arange(120)
        x += np.convolve(hits, np.exp(-0.04 * w) * np.sin(w))[:length]
    if isinstance(part, Gear):
        turns = 2 * np.pi * rate * np.arange(length) / fs
        depth = 1 + 0.1 * np.cos(turns) + 0.05 * np.cos(lines["wheel"].order * turns)
        x += 0.4 * depth * sum(np.cos(k * part.teeth * turns + k) / k for k in (1, 2, 3))
    return Recording({CHANNEL: x}, fs, velocity=2 * np.pi * rate)


def sets_of_faults(every: int) -> list[dict[str, Any]]:
    """Return the share of simulated bearings and gears of which exactly the faults are named."""
    rows = []
    for name, part in [*SIMULATED.items()][::every]:
        kinds = ("pinion", "wheel") if isinstance(part, Gear) else FAULTS.values()
        options: dict[str, Any] = {}
        if isinstance(part, Gear):
            before = [damaged(part, {}, seed) for seed in range(100, 108)]
            options["healthy"] = healthy_scores(before, part)
        found = find_faults([damaged(part, {}, n) for n in range(20)][::every], part, **options)
        row: dict[str, Any] = {
            "part": name,
            "healthy: named": float(is_named(found["named"]).mean()),
        }
        for what, sizes in (("one", (1,)), ("two, equal", (1, 1)), ("two, one of half", (1, 0.5))):
            exact = []
            sets = itertools.permutations(kinds, len(sizes))
            for faults, seed in [*itertools.product(sets, range(20))][::every]:
                run = damaged(part, dict(zip(faults, sizes, strict=True)), seed)
                named = find_faults([run], part, **options)["named"][0].split(" + ")
                exact.append(set(named) == set(faults))
            row[what] = float(np.mean(exact))
        others = [*itertools.product(OTHERS, range(20))][::every]
        runs = [damaged(part, {order: 1}, seed) for order, seed in others]
        found = find_faults(runs, part)
        row["other impacts: named"] = float(is_named(found["named"]).mean())
        rows.append(row)
    return rows


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    json_option(parser)
    parser.add_argument("--quick", action="store_true", help="every 40th recording and draw")
    options = parser.parse_args()
    every = 40 if options.quick else 1
    print(header())
    folder = Path(os.environ.get("EMACM_DATA", "")) / "bearings"
    if (folder / "cwru_faults_12k.npz").exists():
        write_json(options, measured_accuracy(folder, every))
    else:
        print("no recordings of bearings: set EMACM_DATA to the folder that holds bearings/*.npz")
    if (gears := folder.parent / "gear_and_motor").exists():
        print("\ngear rig, with healthy recordings at other loads")
        print(table(gear_rig(gears, every)))
    print("\nsimulated parts, share with the exact set of faults (gears: with healthy ones)")
    print(table(sets_of_faults(every)))


def measured_accuracy(folder: Path, every: int) -> list[dict[str, Any]]:
    """Return the rows of the recordings below a folder, and print their tables."""
    drive, fan = (read_cwru(folder, end, every) for end in BEARINGS)
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of the other packages
        kept = [run for run in drive if run.meta["size"] in SIZES]
        rigs = {
            "CWRU drive end": (kept[::every], BEARINGS["DE12"]),
            "CWRU fan end": (fan[::every], BEARINGS["FE"]),
            "MFPT": (read_mfpt(folder)[::every], MFPT),
        }
        nominal, combed = read_uestc(folder, every)
        rigs |= {"UESTC, nominal": (nominal, UESTC), "UESTC, comb": (combed, UESTC)}
        named = named_by_rig(rigs)
        named += wrong_speeds(
            {rig: each for rig, each in rigs.items() if rig != "UESTC, nominal"}, every
        )
        print("\nMFPT without an answer: share refused or not assessed")
        print(table([without_answer(*rigs["MFPT"])]))
        trained = accuracy(drive, fan, 500 // every)
        print("\nbalanced accuracy, 3 classes (chance 0.33)")
        print(table(trained))
    return [*named, *trained]


if __name__ == "__main__":
    main()
