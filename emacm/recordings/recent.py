"""Values that were computed or read last in this process, up to a number of bytes."""

from __future__ import annotations

import os
from threading import Lock
from typing import Any, Generic, TypeVar

Value = TypeVar("Value")


class Recent(Generic[Value]):
    """Values by key, up to a number of bytes; the oldest is dropped first.

    Parameters
    ----------
    bytes_limit : int
        Limit of the sum of the sizes.

    Examples
    --------
    >>> recent = Recent(100)
    >>> recent.put("a", 1.0, 60)
    >>> recent.put("b", 2.0, 60)
    >>> recent.get("a"), recent.get("b")
    (None, 2.0)
    >>> recent.drop("b")
    >>> recent.get("b") is None
    True
    """

    def __init__(self, bytes_limit: int) -> None:
        self._limit = bytes_limit
        self.clear()
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=self.clear)

    def get(self, key: Any) -> Value | None:
        """Return the value of a key, or None if it is not kept."""
        held = self._held.get(key)
        return None if held is None else held[0]

    def put(self, key: Any, value: Value, n_bytes: int) -> None:
        """Keep a value of this size; nothing is kept that is larger than the limit."""
        with self._lock:
            old = self._held.pop(key, None)
            self._held[key] = value, n_bytes
            self._bytes += n_bytes - (0 if old is None else old[1])
            self._drop_oldest()

    def drop(self, key: Any) -> None:
        """Drop the value of a key, if it is kept."""
        with self._lock:
            self._bytes -= self._held.pop(key, (None, 0))[1]

    def set_limit(self, bytes_limit: int) -> int:
        """Change the limit, and return the previous one."""
        with self._lock:
            before, self._limit = self._limit, bytes_limit
            self._drop_oldest()
        return before

    def _drop_oldest(self) -> None:
        while self._bytes > self._limit:
            self._bytes -= self._held.pop(next(iter(self._held)))[1]

    def clear(self) -> None:
        """Drop all values."""
        self._lock = Lock()  # a forked process may have inherited it locked
        self._held: dict[Any, tuple[Value, int]] = {}
        self._bytes = 0
