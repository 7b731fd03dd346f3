"""Known motions of a shaft, for the tests of what measures it."""

from __future__ import annotations

import numpy as np

from emacm.shaft.motion import find_strokes, paths_along

TURN = 2 * np.pi
FS = 10_000.0
TIME = np.arange(int(3 * FS)) / FS

# Motion: angle [rad] and its speed [rad/s], as functions of time.
MOTIONS = {
    "constant": (lambda t: TURN * 10 * t, lambda t: TURN * 10 + 0 * t),
    "ramp": (lambda t: TURN * (2 * t + 3 * t**2), lambda t: TURN * (2 + 6 * t)),
    "sinusoidal": (
        lambda t: TURN * (10 * t + np.sin(TURN * t) / np.pi),
        lambda t: TURN * (10 + 2 * np.cos(TURN * t)),
    ),
    "reversing": (lambda t: 30 / TURN * (1 - np.cos(TURN * t)), lambda t: 30 * np.sin(TURN * t)),
}


def turned(motion):
    return MOTIONS[motion][0](TIME)


def stroke_paths(angle, velocity, fs, *, min_speed=0.0, **options):
    strokes = find_strokes(velocity, min_speed)
    return paths_along(angle, fs, strokes, min_speed=min_speed, **options)
