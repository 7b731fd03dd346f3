"""Values that are computed once from arrays, as long as no file below these is written."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any

from numpy.typing import NDArray

from emacm.recordings.digests import Stamps, content_digest, file_stamps, is_mapped


class Remembered:
    """Values that depend on certain arrays only, each computed when it is first needed.

    A value is computed again after the file of a memory-mapped array was written. Two threads
    that need a value at the same time may both compute it: there is no lock, so a process can be
    forked at any time.

    Parameters
    ----------
    arrays : sequence of ndarray
        Arrays from which the values are computed.
    just_opened : bool
        Whether memory maps among them have just been opened by name, as after unpickling. Then
        digests of the files are remembered for the whole process, so that a worker process reads a
        file once, however often it receives the recording.
    """

    __slots__ = ("_arrays", "_mapped", "_opened", "_values")

    def __init__(self, arrays: Sequence[NDArray[Any]], *, just_opened: bool) -> None:
        self._arrays = arrays
        self._mapped = [array for array in arrays if is_mapped(array)]
        self._opened = self._stamps() if just_opened else None
        self._values: dict[Hashable, tuple[Stamps, Any]] = {}

    @property
    def in_files(self) -> bool:
        """Whether arrays are read from files, which may be written to."""
        return bool(self._mapped)

    def once(self, name: Hashable, compute: Callable[[], Any], *, most: int | None = None) -> Any:
        """Return the value of this name; compute it if it is unknown or out of date.

        Lists of more than `most` elements are not kept.
        """
        stamps = self._stamps()
        known = self._values.get(name)
        if known is not None and stamps is not None and known[0] == stamps:
            return known[1]
        value = compute()
        small = most is None or len(value) <= most
        if small and stamps is not None and stamps == self._stamps():
            self._values[name] = (stamps, value)
        return value

    def digest(self, facts: Callable[[], str]) -> str:
        """Return the SHA-256 of the arrays and of other facts; computed once."""
        return self.once("digest", lambda: self._digest(facts()))

    def _digest(self, facts: str) -> str:
        same = self._opened is not None and self._opened == self._stamps()
        return content_digest(facts, self._arrays, remember_files=same)

    def _stamps(self) -> Stamps | None:
        return file_stamps(self._mapped)
