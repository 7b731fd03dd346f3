"""Coverage of prediction intervals of the remaining life, on simulated units and on PRONOSTIA.

Simulated: each trial fits a new fleet and predicts one further unit, so that trials are
independent; the coverage at five ages is compared with binomial limits, of which one row in twenty
is outside by chance. Rows of different models have the same units. PRONOSTIA (IEEE PHM 2012
data challenge): one of 17 bearings is left out at a time; beside the models stand two predictions
without any signal. The data are public and not part of the repository; the folder holds
Learning_set and Full_Test_Set, as in the repository wkzs111/phm-ieee-2012-data-challenge-dataset.
Without the folder this part is skipped. Nothing was tuned on these data: the onset is a doubling of
the vibration. Run from the repository:

    OPENBLAS_NUM_THREADS=1 python benchmarks/remaining_life.py [--quick] [--trials 400]
        [--seed 0] [--pronostia FOLDER] [--cache FILE.npz] [--json [FILE]]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from measure import header, json_option, table, write_json
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.stats import binom

from emacm.monitoring import RemainingLife, coverage_by_unit, phm2012_lives, phm2012_score
from emacm.simulation import WearLaw

Array = NDArray[np.float64]

LAW, INTERVAL, N_UNITS, COVERAGE = WearLaw(), 10.0, 30, 0.9
AGES = (50.0, 100.0, 150.0, 200.0, 250.0)  # h
NO_DAMAGE = -40.0  # dB
CASES = (
    ("wiener", ""),
    ("weibull", ""),
    ("wiener", "any age"),
    ("weibull", "any age"),
    ("weibull", "part of the life"),
)
ANY_AGE = 100.0, 900.0  # h: ends of observation, whatever the life is; a fifth are before it
WITHDRAWN = 0.2  # fraction of units that are withdrawn at 0.3 to 1 of their life

PERIOD = 10.0  # s between two records of PRONOSTIA
SETS = ("Learning_set", "Full_Test_Set")
N_MEDIAN = 6  # records of the moving median: one minute
ONSET = 20 * np.log10(2)  # dB above the lowest level so far
EVERY = 10  # records between two readings
FRACTIONS = np.arange(1, 10) / 10  # of the life, at which errors are counted
# Records in the truncated test set of the challenge, after which its score is computed.
TRUNCATED = {
    "Bearing1_3": 1802,
    "Bearing1_4": 1139,
    "Bearing1_5": 2302,
    "Bearing1_6": 2302,
    "Bearing1_7": 1502,
    "Bearing2_3": 1202,
    "Bearing2_4": 612,
    "Bearing2_5": 2002,
    "Bearing2_6": 572,
    "Bearing2_7": 172,
    "Bearing3_3": 352,
}


def simulated_unit(unit: int, seed: int, ends: str, rng: np.random.Generator) -> tuple[Array, ...]:
    """Return X, y and whether the unit is censored."""
    life = LAW.draw(unit, INTERVAL, seed=seed)
    if ends == "any age":
        life = LAW.draw(unit, INTERVAL, seed=seed, observed=rng.uniform(*ANY_AGE))
    elif ends == "part of the life" and rng.uniform() < WITHDRAWN:
        observed = rng.uniform(0.3, 1.0) * life.life
        life = LAW.draw(unit, INTERVAL, seed=seed, observed=observed)
    with np.errstate(divide="ignore"):
        level = np.maximum(20 * np.log10(life.severity), NO_DAMAGE)
    X = np.column_stack([life.ages, level])
    return X, life.observed - life.ages, np.full(len(X), life.censored)


def simulated_intervals(model: str, ends: str, n_trials: int, seed: int) -> pd.DataFrame:
    """Return the interval of a further unit of each fleet at each age, and whether it holds."""
    rng = np.random.default_rng(seed)
    parts = []
    for trial in range(n_trials):
        first = trial * (N_UNITS + 1)
        fleet = [simulated_unit(first + k, seed, ends, rng) for k in range(N_UNITS)]
        X, y, censored = (np.concatenate(part) for part in zip(*fleet, strict=True))
        groups = np.repeat(np.arange(N_UNITS), [len(part[0]) for part in fleet])
        threshold = 0.0 if model == "wiener" else None
        life = RemainingLife(model, onset=-35.0, consecutive=1, threshold=threshold)
        life.fit(X, y, groups=groups, censored=censored)
        X, y, _ = simulated_unit(first + N_UNITS, seed, "", rng)
        rows = np.isin(X[:, 0], AGES)
        found = life.predict_interval(X, np.zeros(len(X)))[rows]
        found["inside"] = (found["lower"] <= y[rows]) & (y[rows] <= found["upper"])
        parts.append(found)
    return pd.concat(parts, ignore_index=True)


def simulated_coverage(model: str, ends: str, n_trials: int, seed: int) -> list[dict[str, Any]]:
    """Return the coverage at each age, with the limits of a binomial number of units."""
    rows = []
    for age, found in simulated_intervals(model, ends, n_trials, seed).groupby("age"):
        n = len(found)
        low, high = binom.ppf([0.025, 0.975], n, COVERAGE) / n
        row = {
            "": f"{model}, {f'observed to {ends}' if ends else 'all failed'}, age {age:.0f} h",
            "units": n,
            "coverage": float(found["inside"].mean()),
            "binomial low": float(low),
            "high": float(high),
        }
        for name, part in {
            "before onset": found["stage"] == "before onset",
            "damage": found["stage"] == "damage",
            "earlier age": found["calibration"] == "earlier age",
            "finite": np.isfinite(found["upper"].astype(float)),
        }.items():
            row[f"{name}: units"] = int(part.sum())
            row[name] = float(found["inside"][part].mean()) if part.any() else None
        rows.append(row)
    return rows


def coverage_range(rows: list[dict[str, Any]], model: str, ends: str) -> dict[str, Any]:
    """Return the least and the largest coverage over the ages of a case."""
    case = f"{model}, {f'observed to {ends}' if ends else 'all failed'}, "
    covered = [row["coverage"] for row in rows if row[""].startswith(case)]
    return {"": f"{case}all ages", "lowest": min(covered), "highest": max(covered)}


def rms_of_records(folder: Path) -> Array:
    """Return the rms of both accelerometers [g] of each record of a bearing, (n_records, 2)."""
    rows = []
    for path in sorted(folder.glob("acc_*.csv")):
        lines = path.read_bytes().replace(b";", b",").split()  # Bearing1_4 has semicolons
        samples = np.array([line.split(b",")[4:6] for line in lines], dtype=np.float64)
        rows.append(np.sqrt(np.mean(samples**2, axis=0)))
    return np.array(rows)


def pronostia_levels(folder: Path, cache: Path | None) -> dict[str, Array]:
    """Return the rms of each bearing, from a cache if there is one."""
    if cache is not None and cache.exists():
        with np.load(cache) as stored:
            return {name: stored[name] for name in sorted(stored.files)}
    folders = sorted(path for name in SETS for path in (folder / name).glob("Bearing*"))
    found = {path.name: rms_of_records(path) for path in folders}
    if not found:
        raise SystemExit(f"{folder} has no folders Bearing* in {' or '.join(SETS)}.")
    if cache is not None:
        np.savez(cache, **found)
    return found


def readings(rms: Array) -> tuple[Array, Array]:
    """Return age, index [dB above the lowest level so far] and remaining life [s].

    Only past records enter a reading; the larger of both directions is used.
    """
    level = 20 * np.log10(rms)
    past = median_filter(level, size=(N_MEDIAN, 1), origin=((N_MEDIAN - 1) // 2, 0), mode="nearest")
    index = (past - np.minimum.accumulate(past, axis=0)).max(axis=1)
    ages = PERIOD * np.arange(1, len(rms) + 1)
    return np.column_stack([ages, index]), ages[-1] - ages


def left_out_predictions(bearings: dict[str, Array]) -> pd.DataFrame:
    """Predict each bearing by the 16 others; one row per reading."""
    tables = {name: readings(rms) for name, rms in bearings.items()}
    parts = []
    for name, (X_all, y_all) in tables.items():
        others = [
            (other, X[::EVERY], y[::EVERY]) for other, (X, y) in tables.items() if other != name
        ]
        X = np.concatenate([part[1] for part in others])
        y = np.concatenate([part[2] for part in others])
        groups = np.concatenate([[part[0]] * len(part[1]) for part in others])
        rows = wanted_rows(name, len(X_all))
        kept = np.union1d(np.arange(0, len(X_all), EVERY), rows)
        part = pd.DataFrame({"bearing": name, "row": kept, "true": y_all[kept]})
        for model in ("weibull", "wiener"):
            fitted = RemainingLife(model, onset=ONSET).fit(X, y, groups=groups)
            found = fitted.predict_interval(X_all[kept], np.zeros(len(kept)))
            columns = ["median", "lower", "upper", "stage"]
            part[[f"{model} {column}" for column in columns]] = found[columns].to_numpy()
        lives = np.array([other[2][0] + other[1][0, 0] for other in others])
        ages = X_all[kept, 0]
        alive = [lives[lives > age] for age in ages]
        limits = [f"{m} {name}" for m in ("weibull", "wiener") for name in columns[:3]]
        part = part.astype(dict.fromkeys(limits, float))
        part["population median"] = [
            np.median(left) - age if len(left) else np.nan
            for left, age in zip(alive, ages, strict=True)
        ]
        running = y > 0
        part["share of age median"] = ages * np.median(y[running] / X[running, 0])
        parts.append(part[np.isin(kept, rows)])
    return pd.concat(parts, ignore_index=True)


def wanted_rows(name: str, n_records: int) -> NDArray[np.intp]:
    """Return the records at the fractions of the life, and the one of the challenge."""
    rows = (FRACTIONS * n_records).astype(np.intp) - 1
    return np.append(rows, TRUNCATED[name] - 1) if name in TRUNCATED else rows


def pronostia(bearings: dict[str, Array]) -> list[dict[str, Any]]:
    """Return errors, coverage and scores of each method."""
    found = left_out_predictions(bearings)
    last = found["bearing"].map(TRUNCATED).sub(1).eq(found["row"])
    ended, inside = found[last], found[~last]
    rng, rows = np.random.default_rng(0), []
    for method in ("weibull", "wiener", "population", "share of age"):
        ratio = np.abs(np.log(inside[f"{method} median"].clip(lower=1.0) / inside["true"]))
        by_bearing = np.exp(ratio.groupby(inside["bearing"]).median()).to_numpy()
        draws = rng.choice(by_bearing, (2000, len(by_bearing)))
        low, high = np.nanquantile(np.nanmedian(draws, axis=1), [0.025, 0.975])
        row = {
            "": method,
            "median error, factor": float(np.nanmedian(by_bearing)),
            "low": float(low),
            "high": float(high),
        }
        names = ended["bearing"].tolist()
        for source in ("official", "files"):
            true = phm2012_lives(source)[names]
            predicted = ended[f"{method} median"].fillna(0.0)
            row[f"score, {source}"] = phm2012_score(true.to_numpy(), predicted.to_numpy())
        if f"{method} lower" in inside:
            limits = inside[[f"{method} lower", f"{method} upper"]].to_numpy()
            by_unit = coverage_by_unit(inside["true"], *limits.T, inside["bearing"].to_numpy())
            row["coverage"] = by_unit.loc["all", "coverage"]
            row["worst bearing"] = by_unit["coverage"].drop("all").min()
            row["infinite"] = float(np.isinf(limits[:, 1]).mean())
            row["before onset at truncation"] = int((ended[f"{method} stage"] != "damage").sum())
        rows.append(row)
    return rows


def main() -> None:
    """Run both parts and print their tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=400)
    parser.add_argument("--quick", action="store_true", help="3 trials, to see that it runs")
    parser.add_argument("--seed", type=int, default=0, help="other seeds are other units")
    parser.add_argument("--pronostia", type=Path)
    parser.add_argument("--cache", type=Path)
    json_option(parser)
    options = parser.parse_args()
    print(header())
    rows: list[dict[str, Any]] = []
    for model, ends in CASES:
        n_trials = 3 if options.quick else options.trials
        rows += simulated_coverage(model, ends, n_trials, options.seed)
    ranges = [coverage_range(rows, model, ends) for model, ends in CASES]
    print(f"\nSimulated: {N_UNITS} units in a fleet, intervals of {COVERAGE:.0%}\n{table(rows)}")
    if options.pronostia is None or not options.pronostia.is_dir():
        print("\nPRONOSTIA: skipped; give the folder of the data by --pronostia.")
    else:
        found = pronostia(pronostia_levels(options.pronostia, options.cache))
        print(f"\nPRONOSTIA: one of 17 bearings left out, intervals of 90 %\n{table(found)}")
        print(
            "The median error is that of the median bearing, with 95 % limits over bearings. The "
            "score is computed with 339 s (official) or 2890 s (files) for Bearing1_4."
        )
        rows += found
    write_json(options, [*ranges, *rows])


if __name__ == "__main__":
    main()
