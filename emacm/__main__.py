"""Command line: ``python -m emacm demo`` and ``python -m emacm reproduce``."""

from __future__ import annotations

import argparse
import importlib.util
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        The command line. Default: that of the process.

    Returns
    -------
    int
        0 if it ran, 2 for bad input, 130 if it was interrupted.
    """
    options = _parser().parse_args(arguments)
    try:
        _check_pictures(options.command)
        options.run(options)
    except (ImportError, OSError, ValueError) as error:
        print(f"emacm: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("emacm: interrupted.", file=sys.stderr)
        return 130
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m emacm", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    demo = commands.add_parser(
        "demo", help="search, decide, save, load and draw, on simulated or real recordings"
    )
    demo.set_defaults(run=_run_demo)
    demo.add_argument(
        "--actuator",
        type=Path,
        metavar="FILE",
        help="recordings of the Cranfield actuator (.npz) in place of simulated ones",
    )
    _add_common(demo, "emacm_demo", "folder for the model and the picture")
    _add_reproduce(commands)
    return parser


def _add_reproduce(commands: argparse._SubParsersAction) -> None:
    command = commands.add_parser(
        "reproduce", help="compute the figures of the thesis anew, and report what agrees"
    )
    command.set_defaults(run=_run_reproduce)
    command.add_argument(
        "--chapter",
        action="append",
        metavar="2|3|4",
        help="only this chapter; may be given several times (default: all)",
    )
    command.add_argument("--quick", action="store_true", help="fewer random draws: within a minute")
    command.add_argument(
        "--overwrite", action="store_true", help="replace a report that lies in the folder"
    )
    _add_common(command, "emacm_reproduction", "folder for the report")


def _add_common(command: argparse.ArgumentParser, out: str, folder: str) -> None:
    command.add_argument(
        "--out", type=Path, default=Path(out), metavar="DIR", help=f"{folder} (default: {out})"
    )
    command.add_argument(
        "--jobs", type=int, default=2, metavar="N", help="processes at the same time (default: 2)"
    )


def _run_demo(options: argparse.Namespace) -> None:
    from emacm import demo  # only now, so that --help answers at once

    out = _writable_folder(options.out)
    if options.actuator is None:
        demo.simulated_demo(out, n_jobs=options.jobs)
    else:
        demo.actuator_demo(options.actuator, out, n_jobs=options.jobs)


def _run_reproduce(options: argparse.Namespace) -> None:
    from emacm.thesis import CHAPTERS, reproduce

    chapters = [_chapter_number(text) for text in options.chapter or CHAPTERS]
    with _stopping_when_told():
        reproduce(
            options.out,
            list(dict.fromkeys(chapters)),
            quick=options.quick,
            overwrite=options.overwrite,
            n_jobs=options.jobs,
        )


def _chapter_number(text: str | int) -> int:
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"a chapter is a number, such as 2, got {text!r}.") from None


@contextmanager
def _stopping_when_told() -> Iterator[None]:
    """Clean up when the process is told to end, as when it is interrupted."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _check_pictures(command: str) -> None:
    if importlib.util.find_spec("matplotlib") is None:
        raise ImportError(f"{command} draws pictures and needs matplotlib; install emacm[plot].")


def _writable_folder(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".emacm"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OSError(f"cannot write to the folder {folder}: {error}") from error
    return folder


if __name__ == "__main__":
    sys.exit(main())
