"""Command line: ``python -m emacm demo``."""

from __future__ import annotations

import argparse
import importlib.util
import sys
from collections.abc import Sequence
from pathlib import Path


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code: 0 if it ran, 2 for bad input.

    Parameters
    ----------
    arguments : sequence of str, optional
        The command line. Default: that of the process.

    Returns
    -------
    int
    """
    options = _parser().parse_args(arguments)
    try:
        _check_pictures()
        out = _writable_folder(options.out)
        if options.actuator is None:
            _demo().simulated_demo(out, n_jobs=options.jobs)
        else:
            _demo().actuator_demo(options.actuator, out, n_jobs=options.jobs)
    except (ImportError, OSError, ValueError) as error:
        print(f"emacm: {error}", file=sys.stderr)
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m emacm", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    demo = commands.add_parser(
        "demo", help="search, decide, save, load and draw, on simulated or real recordings"
    )
    demo.add_argument(
        "--actuator",
        type=Path,
        metavar="FILE",
        help="recordings of the Cranfield actuator (.npz) in place of simulated ones",
    )
    demo.add_argument(
        "--out",
        type=Path,
        default=Path("emacm_demo"),
        metavar="DIR",
        help="folder for the model and the picture (default: emacm_demo)",
    )
    demo.add_argument(
        "--jobs", type=int, default=2, metavar="N", help="processes of the search (default: 2)"
    )
    return parser


def _check_pictures() -> None:
    if importlib.util.find_spec("matplotlib") is None:
        raise ImportError("the demo draws a picture and needs matplotlib; install emacm[plot].")


def _writable_folder(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".emacm"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OSError(f"cannot write to the folder {folder}: {error}") from error
    return folder


def _demo():
    """Import the demo only now, so that --help answers at once."""
    from emacm import demo

    return demo


if __name__ == "__main__":
    sys.exit(main())
