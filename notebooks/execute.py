"""Execute notebooks, and keep their outputs: ``python notebooks/execute.py [NAME ...]``.

Counts and times of the execution are removed. Pictures are stored with 256 colours, a third of the
size: all that cover an area, and mixtures of them for the edges of text and lines.
"""

import base64
import io
import os
import sys
import tempfile
from pathlib import Path

import nbformat
import numpy as np
from nbclient import NotebookClient
from PIL import Image
from scipy.spatial.distance import cdist

FOLDER = Path(__file__).parent
N_COLOURS, N_EXACT = 256, 160  # the most frequent ones are kept exactly


def fewer_colours(picture: Image.Image) -> Image.Image:
    """Return a picture of at most 256 colours, in which the most frequent ones are unchanged."""
    pixels = np.asarray(picture.convert("RGB"))
    colours, numbers, counts = np.unique(
        pixels.reshape(-1, 3), axis=0, return_inverse=True, return_counts=True
    )
    palette = colours[np.argsort(-counts, kind="stable")]
    if len(colours) > N_COLOURS:
        rare = Image.fromarray(palette[None, N_EXACT:])
        reduced = rare.quantize(N_COLOURS - N_EXACT, Image.Quantize.MAXCOVERAGE).convert("RGB")
        palette = np.concatenate([palette[:N_EXACT], np.unique(np.asarray(reduced)[0], axis=0)])
    # The nearest colour is searched here: that of Pillow is of a grid, and moves white.
    distances = cdist(colours, palette)
    nearest = distances.argmin(axis=1).astype(np.uint8)
    stored = Image.fromarray(nearest[numbers.ravel()].reshape(pixels.shape[:2]), "P")
    stored.putpalette(palette.ravel().tolist())
    return stored


def small_png(data: str) -> str:
    """Return a picture with fewer colours, both as base64 text."""
    stored = io.BytesIO()
    with Image.open(io.BytesIO(base64.b64decode(data))) as picture:
        fewer_colours(picture).save(stored, "png", optimize=True)
    return base64.b64encode(stored.getvalue()).decode()


def execute(path: Path) -> None:
    """Execute a notebook in an empty folder, and store it with its outputs."""
    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        resources = {"metadata": {"path": folder}}
        NotebookClient(notebook, timeout=600, resources=resources, record_timing=False).execute()
    for cell in notebook.cells:
        if cell.cell_type != "code":
            continue
        cell.execution_count = None
        for output in cell.outputs:
            if "execution_count" in output:
                output.execution_count = None
            if "image/png" in output.get("data", {}):
                output.data["image/png"] = small_png(output.data["image/png"])
    notebook.metadata["language_info"] = {"name": "python"}
    nbformat.write(notebook, path)


if __name__ == "__main__":
    os.environ.pop("MPLBACKEND", None)  # another one than that of notebooks would drop the pictures
    for name in sys.argv[1:] or sorted(path.stem for path in FOLDER.glob("*.ipynb")):
        print(name)
        execute(FOLDER / f"{name}.ipynb")
