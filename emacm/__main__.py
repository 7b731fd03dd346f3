"""Commands ``emacm score``, ``demo`` and ``reproduce``; also as ``python -m emacm``."""

from __future__ import annotations

import argparse
import importlib.util
import os
import runpy
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from emacm._version import __version__
from emacm.commands.parsers import add_parsers

_INTERRUPTED = 130  # exit code, as of a shell


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status.

    Parameters
    ----------
    arguments : sequence of str, optional
        The command line. Default: that of the process.

    Returns
    -------
    int
        0 if it succeeded, 2 for invalid input, 130 if it was interrupted (SIGINT or SIGTERM);
        for ``score``, 1 if a decision of ``--fail-on`` was made, and 3 if files failed.
    """
    options = _parser().parse_args(arguments)
    try:
        with _signals_as_interruption():
            return options.run(options) or 0
    except (ImportError, OSError, TypeError, ValueError) as error:
        print(f"emacm: {_stated(error)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        _end_workers()
        end_of_progress = "\n" if sys.stderr.isatty() else ""
        print(f"{end_of_progress}emacm: interrupted.", file=sys.stderr)
        return _INTERRUPTED


def _stated(error: Exception) -> str:
    """Return the message of an error; that of the operating system in words."""
    if isinstance(error, FileNotFoundError) and error.filename is not None:
        return f"there is no file {str(error.filename)!r}."
    return str(error)


def _parser() -> argparse.ArgumentParser:
    module = Path(sys.argv[0]).name == "__main__.py"
    parser = argparse.ArgumentParser(
        prog="python -m emacm" if module else "emacm",
        description="Condition monitoring of rotating machines by computed order tracking.",
    )
    parser.add_argument("--version", action="version", version=f"emacm {__version__}")
    commands = parser.add_subparsers(dest="command", required=True)
    add_parsers(commands)
    demo = commands.add_parser(
        "demo", help="search, decide, save, load and draw, on simulated recordings"
    )
    demo.set_defaults(run=_run_demo)
    _add_common(demo, "emacm_demo", "folder for the model and the picture", "in parallel")
    reproduce = commands.add_parser(
        "reproduce", help="compute the published figures of the thesis again, and compare them"
    )
    reproduce.set_defaults(run=_run_reproduce)
    reproduce.add_argument(
        "--chapter",
        action="append",
        type=int,
        metavar="2|3|4|5",
        help="only this chapter; may be given several times (default: all)",
    )
    reproduce.add_argument("--quick", action="store_true", help="fewer draws: about a minute")
    reproduce.add_argument(
        "--overwrite", action="store_true", help="replace an existing report in the folder"
    )
    _add_common(reproduce, "emacm_reproduction", "folder for the report", "processes")
    return parser


def _add_common(command: argparse.ArgumentParser, out: str, folder: str, jobs: str) -> None:
    command.add_argument(
        "--out", type=Path, default=Path(out), metavar="DIR", help=f"{folder} (default: {out})"
    )
    command.add_argument(
        "--jobs",
        type=_job_count,
        default=2,
        metavar="N",
        help=f"number of tasks {jobs}; -1: one per core (default: 2)",
    )


def _job_count(text: str) -> int:
    try:
        n_jobs = int(text)
    except ValueError:
        n_jobs = 0
    if n_jobs < 1 and n_jobs != -1:
        raise argparse.ArgumentTypeError(
            f"expected a whole number of at least 1, or -1 for one per core, got {text!r}"
        )
    return n_jobs


def _run_demo(options: argparse.Namespace) -> None:
    from emacm import demo  # imported here, so that --help and --version answer at once

    _check_matplotlib("demo")
    demo.simulated_demo(_writable_folder(options.out), n_jobs=options.jobs)


def _run_reproduce(options: argparse.Namespace) -> None:
    folder = Path(__file__).parents[1] / "benchmarks" / "thesis"
    if not folder.is_dir():
        raise FileNotFoundError(
            "the reproduction of the thesis is not installed with the package: run it in a copy "
            "of the repository, as python benchmarks/thesis."
        )
    _check_matplotlib("reproduce")
    chapters = [text for number in options.chapter or () for text in ("--chapter", str(number))]
    flags = [f"--{name}" for name in ("quick", "overwrite") if getattr(options, name)]
    common = ["--out", str(options.out), "--jobs", str(options.jobs)]
    sys.argv = [str(folder), *chapters, *flags, *common]
    runpy.run_path(str(folder), run_name="__main__")


@contextmanager
def _signals_as_interruption() -> Iterator[None]:
    """Raise KeyboardInterrupt at the first SIGINT or SIGTERM, and ignore the following ones."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = (signal.SIGINT, signal.SIGTERM)

    def interrupt(number: int, frame: object) -> None:
        for each in numbers:
            signal.signal(each, signal.SIG_IGN)
        raise KeyboardInterrupt

    before = {number: signal.signal(number, interrupt) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _end_workers() -> None:
    """End the worker processes of joblib, if there are any."""
    if "joblib" in sys.modules:
        from joblib.externals.loky import get_reusable_executor

        get_reusable_executor(max_workers=1).shutdown(wait=False, kill_workers=True)


def _check_matplotlib(command: str) -> None:
    if importlib.util.find_spec("matplotlib") is None:
        raise ImportError(
            f"{command} draws pictures and needs matplotlib; run pip install 'emacm[plot]'."
        )


def _writable_folder(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".emacm"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OSError(f"cannot write to the folder {folder}: {error}") from error
    return folder


def run(arguments: Sequence[str] | None = None) -> None:
    """Run a command and end the process with its exit code."""
    code = main(arguments)
    if code == _INTERRUPTED:
        # A thread may still be in compiled code, and would abort the end of the interpreter.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


if __name__ == "__main__":
    run()
