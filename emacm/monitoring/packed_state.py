"""States of a stream as bytes: arrays and numbers only, no pickled code."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np

_EMPTY = "{}"


def packed(state: dict[str, Any]) -> bytes:
    """Return a state as the bytes of an npz file.

    Parameters
    ----------
    state : dict
        Arrays, numbers and texts, also in nested dictionaries, whose keys are texts without "/",
        lists and tuples. Entries that are None are omitted.

    Returns
    -------
    bytes

    Examples
    --------
    >>> unpacked(packed({"values": [1.5, {"name": "current", "none": {}}]}))
    {'values': [array(1.5), {'name': array('current', dtype='<U7'), 'none': {}}]}
    """
    stream = BytesIO()
    np.savez(stream, **_flat(state, ""))
    return stream.getvalue()


def unpacked(content: bytes) -> dict[str, Any]:
    """Return the state whose bytes `packed` returned; lists for tuples, arrays for all values.

    Raises
    ------
    ValueError
        If it is not such a state.
    """
    try:
        with np.load(BytesIO(content), allow_pickle=False) as file:
            arrays = dict(file)
    except Exception as error:  # zip, zlib and NumPy raise many kinds
        raise ValueError(
            f"state must be the bytes that OrderMonitor.state returned, and these cannot be read "
            f"({error}). Was the file written completely?"
        ) from error
    tree: dict[str, Any] = {}
    for path, value in arrays.items():
        *parents, name = path.split("/")
        branch = tree
        for parent in parents:
            branch = branch.setdefault(parent, {})
        branch[name] = value
    return _lists(tree)


def _flat(value: Any, path: str) -> dict[str, Any]:
    if value is None:
        return {}
    if isinstance(value, list | tuple):
        value = {f"#{i}": item for i, item in enumerate(value)} or {"#": np.empty(0)}
    if not isinstance(value, dict):
        array = np.asarray(value)
        if array.dtype.hasobject:  # would be stored as code
            raise TypeError(f"a state holds arrays, numbers and texts, got {value!r} at {path!r}.")
        return {path: array}
    flat: dict[str, Any] = {} if value else {f"{path}/{_EMPTY}": np.empty(0)}
    for name, item in value.items():
        flat |= _flat(item, f"{path}/{name}" if path else str(name))
    return flat


def _lists(tree: Any) -> Any:
    if not isinstance(tree, dict):
        return tree
    branches = {name: _lists(item) for name, item in tree.items() if name != _EMPTY}
    if any(name.startswith("#") for name in branches):
        return [branches[f"#{i}"] for i in range(len(branches)) if f"#{i}" in branches]
    return branches
