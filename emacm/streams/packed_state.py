"""States of streams as bytes, and objects whose state is that of some of their attributes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from io import BytesIO
from typing import Any, ClassVar

import numpy as np


class Resumable:
    """An object that can be continued from the values of some attributes.

    Attributes
    ----------
    held : tuple of str
        Names of these attributes; all, if there are none. They are arrays, numbers, texts, named
        tuples, objects that have `state` and `restore`, and lists and dictionaries of them. An
        object is continued, so it must have been made: of a dictionary of objects, those that are
        in the state are kept.
    """

    held: ClassVar[tuple[str, ...]] = ()

    def state(self) -> dict[str, Any]:
        """Return all that `restore` needs."""
        return {name: getattr(self, name) for name in self.held or vars(self)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state that was packed and unpacked."""
        for name, value in self.state().items():
            setattr(self, name, _restored_value(value, state[name]))


def _restored_value(value: Any, state: Any) -> Any:
    if hasattr(value, "restore"):
        value.restore(state)
        return value
    if isinstance(value, dict):
        return {k: _restored_value(v, state[k]) for k, v in value.items() if k in state}
    if isinstance(value, list) and any(hasattr(item, "restore") for item in value):
        return [_restored_value(*pair) for pair in zip(value, state, strict=True)]
    return value._make(state) if hasattr(value, "_make") else state


def packed(state: dict[str, Any]) -> bytes:
    """Return a state as the bytes of an npz file.

    Parameters
    ----------
    state : dict
        Arrays, numbers, texts and None, objects that have such a `state`, and lists, tuples and
        dictionaries of them, whose keys are texts or numbers.

    Returns
    -------
    bytes

    Examples
    --------
    >>> unpacked(packed({"values": (1.5, {"name": "current", 2: np.arange(3)})}))
    {'values': [1.5, {'name': 'current', '2': array([0, 1, 2])}]}
    """
    arrays: list[Any] = []

    def stored(value: Any) -> Any:
        if hasattr(value, "state"):
            return value.state()
        arrays.append(value)
        return {"array": len(arrays) - 1}

    text, stream = json.dumps(state, default=stored), BytesIO()
    np.savez(stream, *arrays, text=text)
    return stream.getvalue()


def unpacked(content: bytes) -> dict[str, Any]:
    """Return the state whose bytes `packed` returned; lists for tuples, and texts as keys.

    Raises
    ------
    ValueError
        If it is not such a state.
    """
    try:
        with np.load(BytesIO(content), allow_pickle=False) as file:

            def restored(entry: dict[str, Any]) -> Any:
                return file[f"arr_{entry['array']}"] if "array" in entry else entry

            return json.loads(file["text"].item(), object_hook=restored)
    except Exception as error:  # zip, zlib and NumPy raise many kinds
        raise ValueError(
            "it is no state of OrderMonitor, or was not written completely."
        ) from error
