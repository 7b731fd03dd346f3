"""Sections of a signal over shaft angle: a fixed number of segments of Welch's method each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

# Whole, or in consecutive blocks; shape (n_channels, n_angles).
Signal = NDArray[np.floating] | Iterable[NDArray[np.floating]]
Section = tuple[NDArray[np.floating], int, int]

_SECTION_BYTES = 1 << 19  # of the transforms of a section
# Longer segments: a few pairs of them, if this suffices, as each section takes about 50 us besides.
_FEW_PAIRS, _LONG_SECTION_BYTES = 3, 1 << 20


def sections(signals: Iterable[Signal], length: int, step: int) -> Iterator[Section]:
    """Yield sections of signals, the start of the first segment in each, and how many there are.

    Segments have `length` samples; each begins `step` samples after the one before. No segment
    spans two signals, which are read one at a time; shorter signals are skipped.
    """
    for signal in signals:
        cutter = SectionCutter(length, step)
        for block in [signal] if isinstance(signal, np.ndarray) else signal:
            yield from cutter.add(block)
            del block  # before the next one is made
        yield from cutter.finish()


class SectionCutter:
    """Cuts a signal that comes block by block into sections of an equal number of segments.

    A sum over segments is therefore the same bit for bit, whatever the blocks are.

    Parameters
    ----------
    length, step : int
        As for `sections`.

    Attributes
    ----------
    rest : list of ndarray of shape (n_channels, n_angles)
        The samples from the start of the next section on.
    """

    def __init__(self, length: int, step: int) -> None:
        self._length, self._step = length, step
        self.rest: list[NDArray[np.floating]] = []

    def add(self, block: NDArray[np.floating]) -> Iterator[Section]:
        """Yield the sections that are complete with the next samples."""
        # An even number, as two segments may be transformed together.
        n_bytes = 16 * self._length * len(block)
        few = min(_FEW_PAIRS, _LONG_SECTION_BYTES // n_bytes)
        n_segments = 2 * max(1, few, _SECTION_BYTES // n_bytes)
        onward = n_segments * self._step
        whole, n_rest = onward - self._step + self._length, self._n_rest
        n_complete = (n_rest + block.shape[1] - whole) // onward + 1
        if n_complete < 1:
            self.rest.append(block.copy())
            return
        start = -n_rest  # of the next section, in the block
        if self.rest:
            # Sections that begin in the rest; only their samples are copied.
            n_joined = min(n_complete, -(-n_rest // onward))
            stop = start + (n_joined - 1) * onward + whole
            joined = np.concatenate([*self.rest, block[:, :stop]], axis=1)
            for k in range(n_joined):
                yield joined, k * onward, n_segments
            start += n_joined * onward
            self.rest = [joined[:, n_joined * onward : n_rest].copy()]
            del joined
        for first in range(start, n_complete * onward - n_rest, onward):
            yield block, first, n_segments
        self.rest = [*self.rest, block[:, max(0, n_complete * onward - n_rest) :].copy()]

    def finish(self) -> Iterator[Section]:
        """Yield the last section, which may be shorter."""
        count = (self._n_rest - self._length) // self._step + 1
        if count > 0:
            yield np.concatenate(self.rest, axis=1), 0, count

    @property
    def _n_rest(self) -> int:
        return sum(part.shape[1] for part in self.rest)
