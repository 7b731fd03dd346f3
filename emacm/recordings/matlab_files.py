"""Reader of MAT files: version 4 to 7.2 by SciPy, version 7.3 by h5py."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from emacm.recordings.file_columns import FileColumns
from emacm.recordings.readers import add_array, optional_library, settled

_HDF5 = b"\x89HDF\r\n\x1a\n"


def read_mat(path: Path) -> FileColumns:
    """Return the numeric arrays of a MAT file; fields of structures as "structure.field".

    Elements of cells and of arrays of structures are numbered from 0, as "cell.0".

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    FileColumns
    """
    with open(path, "rb") as file:
        start = file.read(520)
    content = FileColumns({})
    if _HDF5 in (start[:8], start[512:]):
        _add_groups(content, path)
    else:
        for name, value in scipy.io.loadmat(path, simplify_cells=True).items():
            if not name.startswith("__"):
                _add(content, name, value)
    return settled(content)


def _add(content: FileColumns, name: str, value: Any) -> None:
    if isinstance(value, Mapping):
        for field, inner in value.items():
            _add(content, f"{name}.{field}", inner)
    elif isinstance(value, list | tuple) or _holds_objects(value):
        for number, inner in enumerate(value):  # cells, and arrays of structures
            _add(content, f"{name}.{number}", inner)
    elif isinstance(value, np.ndarray | np.number | int | float):
        add_array(content, name, value)
    elif isinstance(value, str) and name.rpartition(".")[2].lower() in ("unit", "units"):
        content.units[name.rpartition(".")[0]] = value
    else:
        kind = "is sparse" if scipy.sparse.issparse(value) else "is a text"
        content.ignored[name] = f"{kind}, no array of numbers"


def _holds_objects(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind == "O" and value.ndim > 0


def _add_groups(content: FileColumns, path: Path) -> None:
    h5py = optional_library("h5py", "MAT 7.3")

    def add(name: str, node: Any) -> None:
        kind = node.attrs.get("MATLAB_class", b"")
        if isinstance(node, h5py.Dataset) and kind not in (b"char", b"cell") and "#" not in name:
            add_array(content, name.replace("/", "."), node[()])

    with h5py.File(path, "r") as file:
        file.visititems(add)
