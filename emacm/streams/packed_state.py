"""States of streams as bytes."""

from __future__ import annotations

import json
from io import BytesIO
from typing import Any

import numpy as np


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
