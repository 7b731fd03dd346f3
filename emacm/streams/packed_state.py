"""States of streams as bytes, and objects whose state is that of some of their attributes."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from typing import Any, ClassVar

import numpy as np

_EMPTY = "{}"


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
            setattr(self, name, _continued(value, state[name]))


def _continued(value: Any, state: Any) -> Any:
    if hasattr(value, "restore"):
        value.restore(state)
        return value
    if isinstance(value, dict):
        return {k: _continued(v, state[str(k)]) for k, v in value.items() if str(k) in state}
    if isinstance(value, list) and any(hasattr(item, "restore") for item in value):
        return [_continued(*pair) for pair in zip(value, state, strict=True)]
    return value._make(state) if hasattr(value, "_make") else state


def packed(state: dict[str, Any]) -> bytes:
    """Return a state as the bytes of an npz file.

    Parameters
    ----------
    state : dict
        Arrays, numbers and texts, also in nested dictionaries, whose keys as texts have no "/",
        lists, tuples, and objects that have such a `state`. Entries that are None are omitted.

    Returns
    -------
    bytes

    Examples
    --------
    >>> unpacked(packed({"values": [1.5, {"name": "current", "none": {}}]}))
    {'values': [1.5, {'name': 'current', 'none': {}}]}
    """
    stream = BytesIO()
    np.savez(stream, **_flat(state, ""))
    return stream.getvalue()


def unpacked(content: bytes) -> dict[str, Any]:
    """Return the state whose bytes `packed` returned; lists for tuples.

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
    if hasattr(value, "state"):
        value = value.state()
    if isinstance(value, list | tuple):
        value = {f"#{i}": item for i, item in enumerate(value)} or {"#": np.empty(0)}
    if not isinstance(value, dict):
        return {path: value}
    flat: dict[str, Any] = {} if value else {f"{path}/{_EMPTY}": np.empty(0)}
    for name, item in value.items():
        flat |= _flat(item, f"{path}/{name}" if path else str(name))
    return flat


def _lists(tree: Any) -> Any:
    if not isinstance(tree, dict):
        return tree if tree.ndim else tree.item()
    branches = {name: _lists(item) for name, item in tree.items() if name != _EMPTY}
    if any(name.startswith("#") for name in branches):
        return [branches[f"#{i}"] for i in range(len(branches)) if f"#{i}" in branches]
    return branches
