"""Resampled signals of one recording, kept for the next reader."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.shaft.paths import ShaftPath

Block = NDArray[np.floating]

_ENTRY = 1000  # bytes that the entry of a stroke takes besides its signals


class KeptSignals:
    """Blocks of resampled signals, stroke by stroke, up to a total size.

    Signals that do not fit are resampled whenever they are read. Blocks are kept as they were
    computed. Every reader therefore receives the same blocks, and its sums are identical bit for
    bit. There is no lock: two threads that read the same stroke at the same time may both resample
    it.

    Parameters
    ----------
    max_bytes : int
        Size up to which signals are kept.
    """

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._used = 0
        self._blocks: dict[Any, list[Block]] = {}

    def blocks(
        self, path: ShaftPath, rows: Sequence[int], n_angles: int, stream: Iterator[Block]
    ) -> Iterator[Block]:
        """Yield the blocks of a stroke: those that are kept, or those of `stream`.

        Parameters
        ----------
        path : ShaftPath
            Travel of the shaft along the stroke.
        rows : sequence of int
            Indices of the channels.
        n_angles : int
            Number of samples over the angle.
        stream : iterator of ndarray of shape (n_rows, n_angles)
            The resampled blocks; not computed if they are kept already.

        Yields
        ------
        ndarray of shape (n_rows, n_angles)
            Consecutive blocks.
        """
        key = (path.start_time, path.start_angle, path.direction, path.n_times, *rows)
        known = self._blocks.get(key)
        if known is not None:
            yield from known
            return
        held: list[Block] | None = []
        size, done = _ENTRY, 0
        for block in stream:
            size, done = size + block.nbytes, done + block.shape[1]
            if self._used + size > self._max_bytes:
                held = None  # too large: what was held so far is released
            if held is not None:
                held.append(block)
                if done == n_angles and key not in self._blocks:
                    self._used += size
                    self._blocks[key] = held
            yield block
