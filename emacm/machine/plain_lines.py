"""Lines in plain order spectra, compared with healthy recordings: sidebands of gears, 1x and 2x."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.findings.training_range import line_heights
from emacm.machine.fault_lines import FaultLines, nearest_lines, resolution
from emacm.machine.fault_orders import gears_and_orders
from emacm.orders.columns import column_names, parse_order_columns
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.inputs import chosen_channels
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler

Array = NDArray[np.float64]


class PlainLines(NamedTuple):
    """Lines of one channel of a recording, in the order spectrum of the signal itself.

    Attributes
    ----------
    speed : float
        Mean speed of the shaft [rad/s].
    load : object
        "load" of the recording's `meta`; None if it is not stated.
    levels : DataFrame
        Index: "pair" (number of a pair of gears; -1: of none), "name" and "harmonic". Of a gear,
        such as "pinion", one row per harmonic of the mesh, for its three sidebands on either side;
        of an order, such as "1x", one row. Columns [dB]: "level" (of sidebands the mean),
        "relative" (above the median of the spectrum), "height" (above the floor between lines; of
        sidebands the median) and "mesh" (level of the harmonic of the mesh; NaN for an order).
    """

    speed: float
    load: Any
    levels: pd.DataFrame


def measure_plain_lines(
    recording: Recording, levels: FaultLines, n_revolutions: int
) -> dict[str, PlainLines]:
    """Measure sidebands of gears, 1x, 2x and stated orders in each channel of a recording.

    Parameters
    ----------
    recording : Recording
        Vibration as measured.
    levels : FaultLines
        States parts, harmonics (of each mesh, as far as the sampling rate supports them), slip
        (largest deviation from the stated orders) and channels; it need not be fitted.
    n_revolutions : int
        Length of the longest stroke.

    Returns
    -------
    dict of str to PlainLines
        By channel. Lines that the spectrum does not resolve, or does not reach, have no row.
    """
    gears, orders = gears_and_orders(levels.parts)
    orders |= {f"{x:g}x": x for x in (1.0, 2.0) if x not in orders.values()}
    speeds = np.abs(recording.velocity)
    chosen = chosen_channels(levels.channels, recording.channels)
    triples = [gear.lines()[:3] for gear in gears]
    highest = max(orders.values()) * (1 + levels.slip) + 1
    for mesh, *turning in triples:
        highest = max(highest, levels.harmonics * mesh.order + 4 * max(t.order for t in turning))
    fastest = speeds.max() / (2 * np.pi)
    top = min(highest, 0.4 * min(recording.fs[name] for name in chosen) / fastest)
    slowest = min((turn.order for _, *turning in triples for turn in turning), default=1.0)
    length = min(max(25, int(np.ceil(4 / slowest))), n_revolutions)
    resampler = OrderResampler(2 * np.pi / (2.6 * top), channels=levels.channels)
    table = OrderPSD(length, max_order=top).fit_transform(resampler.fit_transform([recording]))
    found = {}
    for block in parse_order_columns(column_names(table) or ()) or ():
        psd = np.asarray(table, np.float64)[0, block.columns]
        spectrum = _PlainSpectrum(np.asarray(block.orders, np.float64), psd)
        rows = list(spectrum.rows_of_orders(orders, levels.slip))
        for pair, (gear, (mesh, *turning)) in enumerate(zip(gears, triples, strict=True)):
            prefix = f"{gear.name} " if gear.name else ""
            turns = {prefix + turn.name: turn.order for turn in turning}
            meshes = mesh.order * np.arange(1, levels.harmonics + 1, dtype=np.float64)
            rows += spectrum.rows_of_gears(pair, meshes, turns)
        index = ["pair", "name", "harmonic"]
        known = pd.DataFrame(rows, columns=[*index, "level", "relative", "height", "mesh"])
        speed, load = float(speeds.mean()), recording.meta.get("load")
        found[block.channel] = PlainLines(speed, load, known.set_index(index))
    return found


class _PlainSpectrum(NamedTuple):
    """The order spectrum of a signal."""

    orders: Array
    psd: Array

    def rows_of_orders(self, orders: Mapping[str, float], slip: float) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of orders, as in `PlainLines`."""
        for name, order in orders.items():
            if resolution(self.orders) <= order and order * (1 + slip) < self.orders[-3]:
                slips = np.linspace(-slip, slip, 2 * int(slip * order / self.orders[1]) + 3)
                lines = order * (1 + slips)
                yield self._row(-1, name, 1, lines[[self._decibels(lines).argmax()]])

    def rows_of_gears(
        self, pair: int, meshes: Array, turns: Mapping[str, float]
    ) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of a pair of gears, whose shafts turn at some orders."""
        step = resolution(self.orders)
        meshes = meshes[meshes * 1.005 + 3 * max(turns.values()) < self.orders[-3]]
        if not len(meshes):
            return
        # An error of the speed of a fraction of a percent moves these lines by several ones.
        reach = min(0.005, 0.4 * min(turns.values()) / meshes[0])
        factors = 1 + reach * np.linspace(-1, 1, 201)
        factor = factors[self._decibels(np.outer(factors, meshes)).mean(axis=1).argmax()]
        for name, turn in turns.items():
            sides = turn * np.arange(1, 4)
            others = [k * order for order in turns.values() if order != turn for k in (1, 2, 3)]
            apart = [side for side in sides if all(abs(side - o) >= step for o in others)]
            offsets = np.outer([1, -1], apart or sides).ravel()
            for harmonic, mesh in enumerate(meshes, 1):
                if turn >= step:
                    yield self._row(pair, name, harmonic, factor * (mesh + offsets), factor * mesh)

    def _row(
        self, pair: int, name: str, harmonic: int, lines: Array, mesh: float | None = None
    ) -> tuple[Any, ...]:
        level = float(self._decibels(lines).mean())
        relative = level - float(_decibels(np.median(self.psd)))
        heights = line_heights(self.psd[np.newaxis], 25, 0.25)[0][self._near(lines, 1)].max(axis=-1)
        of_mesh = np.nan if mesh is None else float(self._decibels(mesh))
        return pair, name, harmonic, level, relative, float(np.median(heights)), of_mesh

    def _near(self, orders: Any, reach: int) -> NDArray[np.intp]:
        """Return the numbers of the lines of the axis around each order."""
        return np.add.outer(nearest_lines(orders, self.orders), np.arange(-reach, reach + 1))

    def _decibels(self, orders: Any) -> Array:
        """Return the mean over the main lobe of a Hann window at each order [dB]."""
        return _decibels(self.psd[self._near(orders, 2)].mean(axis=-1))


def _decibels(power: Any) -> Array:
    return np.asarray(10 * np.log10(np.maximum(power, np.finfo(np.float64).tiny)))


def nearest_conditions(own: PlainLines, healthy: Sequence[PlainLines]) -> list[PlainLines]:
    """Return the healthy recordings of the nearest speed and load, at least three if there are.

    Speeds within 1 % count as equal. Differences of speed and of load are taken relative to their
    range in the healthy recordings. Loads count if all are numbers.

    Examples
    --------
    >>> runs = [PlainLines(speed, None, pd.DataFrame()) for speed in (90, 100, 100, 100, 140)]
    >>> [run.speed for run in nearest_conditions(runs[1], runs)]
    [100, 100, 100]
    """
    runs = [own, *healthy]
    loads = pd.to_numeric(pd.Series([run.load for run in runs]), errors="coerce").to_numpy(float)
    distance = np.zeros(len(healthy))
    for (at, *others), equal in ((np.log([run.speed for run in runs]), 0.01), (loads, 0.0)):
        far = np.maximum(np.abs(np.array(others) - at) - equal, 0) / (np.ptp(others) or 1.0)
        distance += np.nan_to_num(far)
    third = np.sort(distance)[: min(3, len(healthy))][-1]
    return [run for run, far in zip(healthy, distance, strict=True) if far <= third]


def missing_condition(own: PlainLines, healthy: Sequence[PlainLines]) -> str:
    """Return which condition of a recording healthy ones do not have, as a sentence, or "".

    Examples
    --------
    >>> run, *healthy = [PlainLines(100.0, load, pd.DataFrame()) for load in (40, 0, 20)]
    >>> missing_condition(run, healthy)
    'none of them has a load like 40'
    """
    speed = min((run.speed for run in healthy), key=lambda speed: abs(speed - own.speed))
    if abs(speed / own.speed - 1) >= 0.05:
        own_rpm, rpm = own.speed * 30 / np.pi, speed * 30 / np.pi
        return f"none of them runs at {own_rpm:.0f} rpm, the nearest at {rpm:.0f} rpm"
    loads = [run.load for run in healthy if abs(run.speed / own.speed - 1) < 0.05]
    if own.load is None or None in loads or own.load in loads:
        return ""
    load, *others = pd.to_numeric(pd.Series([own.load, *loads]), errors="coerce")
    # Measured loads vary; of four even loads, a third of the range is one step.
    reach = max(0.1 * np.abs(others).max(), 0.34 * np.ptp(others))
    if min(others) - reach <= load <= max(others) + reach:  # not if one is no number
        return ""
    return f"none of them has a load like {own.load}"


def rises(own: PlainLines, healthy: Sequence[PlainLines]) -> pd.DataFrame:
    """Return how far lines rose above the highest ones of the nearest healthy recordings.

    A rise is that of the level or of the level relative to the spectrum, whichever is less, so that
    neither a change of the gain nor one of the noise is a rise.

    Parameters
    ----------
    own : PlainLines
        Of the recording.
    healthy : sequence of PlainLines
        Of the same machine and channel without faults; at least one.

    Returns
    -------
    DataFrame
        Rows as in `PlainLines`, of lines that all have. Columns [dB]: "rise", "mesh" (rise of the
        harmonic of the mesh) and "height".
    """
    nearest = nearest_conditions(own, healthy)
    highest = pd.concat([run.levels for run in nearest]).groupby(level=[0, 1, 2]).max()
    above = (own.levels - highest).loc[own.levels.index.intersection(highest.index)]
    above["rise"] = above[["level", "relative"]].min(axis=1)
    above["height"] = own.levels["height"]
    return above[["rise", "mesh", "height"]]
