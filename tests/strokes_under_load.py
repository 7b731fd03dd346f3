"""Recordings of an actuator that moves to and fro under load, for the tests of baselines."""

from __future__ import annotations

import numpy as np

from emacm import OrderResampler, Recording

TURN = 2 * np.pi
THETA_S = TURN / 32
FS = 500
LINE = 3.5  # order of the fault


def motion(offset=0.0, cycles=1, seconds=4.0):
    """To and fro between `offset` and 15 turns on, `cycles` times."""
    times = np.arange(int(FS * seconds * cycles)) / FS
    return offset + TURN * 7.5 * (1 - np.cos(TURN * times / seconds))


def profile(angle, way, load):
    """What a healthy actuator shows: it depends on angle, direction and load."""
    shape = np.sin(2 * angle) + 0.02 * angle
    return shape * (1 + load / 40) + np.where(way > 0, 0.8, -0.3) * np.cos(3 * angle)


def run(load=20, fault=0.0, *, offset=0.0, noise=0.0, seed=0, cycles=1, names=("current",), **meta):
    rng = np.random.default_rng(seed)
    angle = motion(offset, cycles)
    way = np.gradient(angle)
    signal = profile(angle, way, load) + fault * np.sin(LINE * angle)
    signal = signal + noise * rng.standard_normal(len(angle))
    signals = {name: signal * (1 + k) for k, name in enumerate(names)}
    return Recording(signals, FS, angle=angle, meta={"load": load, **meta})


def over_angle(runs, **options):
    return OrderResampler(**{"theta_s": THETA_S, "min_speed": 2.0} | options).fit_transform(runs)


OFFSETS = (0.0, 0.013, -0.08, 0.11)


def made_fleet():
    """Healthy and worn recordings under two loads, which start at nearly the same angle."""
    cases = [
        (load, fault, offset, seed)
        for seed, offset in enumerate(OFFSETS)
        for load in (20, 40)
        for fault in (0.0, 0.3)
    ]
    runs = [
        run(load, fault, offset=offset, noise=0.02, seed=10 * seed + i)
        for i, (load, fault, offset, seed) in enumerate(cases)
    ]
    return runs, np.array(["worn" if fault else "healthy" for _, fault, _, _ in cases])


def inside(stroke, margin=16):
    """The signals of a stroke without its ends, where resampling sees no neighbours."""
    return stroke.signals[:, margin:-margin]
