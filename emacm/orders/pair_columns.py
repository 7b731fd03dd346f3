"""What pairs of channels of one recording become: columns of real numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from emacm._checks import check_choice, located
from emacm.orders.cross_spectrum import CrossAverages, Pair, cross_averages
from emacm.orders.welch import SegmentPlan, too_short
from emacm.recordings.inputs import described
from emacm.resampling.angle_recording import AngleRecording, AngleStroke
from emacm.resampling.inputs import strokes_by_kind

# Share of its largest value that a constant varies by once it is resampled, and rounded; assumed.
_RESAMPLED, _ROUNDED = 1e-8, 4

KINDS = ("response", "coherence", "cross")
Part = tuple[str, Callable[[Any], NDArray[np.floating]]]
# Which real columns a complex quantity becomes.
FORMS: dict[str, tuple[Part, ...]] = {
    "rectangular": (("real", np.real), ("imag", np.imag)),
    "polar": (("magnitude", np.abs), ("phase", np.angle)),
    "log": (("log", lambda values: np.log(np.abs(values))), ("phase", np.angle)),
}


class PairColumns(NamedTuple):
    """All that the columns of a recording depend on.

    Attributes
    ----------
    plan : SegmentPlan
        How strokes are cut into segments.
    channels : tuple of str
        Channels that are read.
    pairs : tuple of (int, int)
        Numbers of the input and the output channel of each pair.
    kinds : tuple of {"response", "coherence", "cross"}
        What is wanted of each pair.
    form : {"rectangular", "polar", "log"}
        What complex kinds give.
    operator : sparse array of shape (n_bins, n_orders), or None
        Gathers lines into bins, before ratios are formed.
    by_direction : bool
        Keep forward and reverse strokes apart.
    short : {"raise", "pad"}
        What becomes of recordings without a stroke as long as a segment.
    """

    plan: SegmentPlan
    channels: tuple[str, ...]
    pairs: tuple[Pair, ...]
    kinds: tuple[str, ...]
    form: str
    operator: sparse.csr_array | None
    by_direction: bool
    short: str

    @property
    def names(self) -> list[str]:
        """Names of the columns, up to the @, in order."""
        parts = [name for name, _ in FORMS[self.form]]
        quantities = [
            name
            for kind in self.kinds
            for name in ([kind] if kind == "coherence" else [f"{kind}.{part}" for part in parts])
        ]
        signs = "+-" if self.by_direction else ("",)
        return [
            f"{self.channels[x]}*{self.channels[y]}:{quantity}{sign}"
            for x, y in self.pairs
            for quantity in quantities
            for sign in signs
        ]

    def of(self, row: AngleRecording, index: int) -> NDArray[np.floating]:
        """Estimate the columns of one recording.

        Parameters
        ----------
        row : AngleRecording
            The recording.
        index : int
            Its number, for messages.

        Returns
        -------
        ndarray of shape (n_pairs, n_quantities, n_directions, n_orders)

        Raises
        ------
        ValueError
            If it holds too few segments, a channel has no power or a value is not finite.
        """
        with located(partial(described, row, index)):
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                kinds = strokes_by_kind(row.strokes, self.by_direction)
                ways = [self._quantities(self._averages(row, some, kind)) for kind, some in kinds]
            columns = np.stack(ways, axis=2)
            if not np.all(np.isfinite(columns)):
                raise ValueError(
                    "some value is beyond what a float can hold, or the logarithm of 0. State the "
                    "channels in other units, or use form='rectangular'."
                )
            return columns

    def _averages(
        self, row: AngleRecording, strokes: Sequence[AngleStroke], kind: str
    ) -> CrossAverages:
        """Average over the strokes that hold a segment, resampling them a block at a time."""
        plan = self.plan
        rows = [row.channels.index(name) for name in self.channels]
        whole = [stroke for stroke in strokes if stroke.n_angles >= plan.n_per_segment]
        peaks = np.zeros(len(rows))
        if whole:
            segments = plan.lines_of(_noting(s.joint_blocks(rows), peaks) for s in whole)
        elif self.short == "pad" and any(stroke.n_angles > 1 for stroke in strokes):
            signals = (
                np.concatenate(list(_noting(s.joint_blocks(rows), peaks)), axis=1) for s in strokes
            )
            segments = plan.padded_lines(signals)
        else:
            raise too_short(strokes, plan, kind, "OrderCrossSpectrum")
        averages = cross_averages(plan, segments, self.pairs, self.channels)
        # Of a constant, whose mean is taken out, only such errors are left: as good as no power.
        errors = max(_RESAMPLED, _ROUNDED * float(np.finfo(row.dtype).eps)) * peaks
        stuck = averages.power.max(axis=1) <= errors**2
        averages = replace(averages, power=np.where(stuck[:, np.newaxis], 0.0, averages.power))
        return averages if self.operator is None else averages.gathered(self.operator)

    def _quantities(self, averages: CrossAverages) -> NDArray[np.floating]:
        """Return what is wanted of the averages, shape (n_pairs, n_quantities, n_orders)."""
        columns: list[NDArray[np.floating]] = []
        for kind in self.kinds:
            if kind == "coherence":
                columns.append(averages.coherence())
            else:
                values = averages.response() if kind == "response" else averages.cross
                columns += [part(values) for _, part in FORMS[self.form]]
        return np.stack(columns, axis=1)


def _noting(
    blocks: Iterable[NDArray[np.floating]], peaks: NDArray[np.floating]
) -> Iterator[NDArray[np.floating]]:
    """Pass blocks on, and keep the largest size of each channel in `peaks`."""
    for block in blocks:
        np.maximum(peaks, np.abs(block).max(axis=1, initial=0.0), out=peaks)
        yield block


def check_kinds(kind: Any) -> tuple[str, ...]:
    """Return the kinds as a tuple, or say which there are."""
    kinds = (kind,) if isinstance(kind, str) else tuple(kind) if np.iterable(kind) else (kind,)
    for one in kinds:
        check_choice(one, "kind", KINDS)
    if not kinds or len(set(kinds)) < len(kinds):
        raise ValueError(f"kind must name one or more of {KINDS}, each once; got {kind!r}.")
    return kinds
