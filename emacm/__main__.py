"""Commands ``emacm score``, ``demo`` and ``reproduce``; also as ``python -m emacm``."""

from __future__ import annotations

import argparse
import os
import runpy
import signal
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from emacm._version import __version__
from emacm.commands.parsers import add_parsers, adder

_INTERRUPTED, _NO_READER = 130, 141  # exit codes, as of a shell


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status.

    Parameters
    ----------
    arguments : sequence of str, optional
        The command line. Default: that of the process.

    Returns
    -------
    int
        0 if it succeeded, 2 for invalid input, 130 if it was interrupted (SIGINT or SIGTERM), 141
        if the program that reads the output has ended; for ``score``, 1 if a decision of
        ``--fail-on`` was made, also if files failed, and else 3 if files failed.
    """
    parser = _parser()
    try:
        options = parser.parse_args(arguments)
        with _as_a_command():
            status = options.run(options) or 0
            sys.stdout.flush()
            return status
    except BrokenPipeError:  # the reader of the output, such as `head`, has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for what is left at exit
        return _NO_READER
    except (ImportError, OSError, TypeError, ValueError) as error:
        print(f"emacm: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        _end_workers()
        end_of_progress = "\n" if sys.stderr.isatty() else ""
        print(f"{end_of_progress}emacm: interrupted.", file=sys.stderr)
        return _INTERRUPTED


@contextmanager
def _as_a_command() -> Iterator[None]:
    """Print warnings without lines of Python, and take SIGTERM as SIGINT: KeyboardInterrupt."""
    usual, handler = warnings.formatwarning, signal.getsignal(signal.SIGTERM)
    warnings.formatwarning = lambda message, *_: f"emacm: WARNING: {message}\n"
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        warnings.formatwarning = usual
        signal.signal(signal.SIGTERM, handler)


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, like those of the commands."""

    def error(self, message: str) -> NoReturn:
        """Raise a ValueError."""
        raise ValueError(f"{message}. See {self.prog} --help.")


def _parser() -> argparse.ArgumentParser:
    module = Path(sys.argv[0]).name == "__main__.py"
    parser = _Parser(
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
    add, folder = adder(demo), "folder for the model and the picture (default: emacm_demo)"
    add("--out", Path, "DIR", folder, default=Path("emacm_demo"))
    reproduce = commands.add_parser(
        "reproduce",
        help="compute the published figures of the thesis again, and compare them",
        add_help=False,
        prefix_chars=" ",  # nothing is an option here: benchmarks/thesis has its own
    )
    reproduce.add_argument("others", nargs="*")
    reproduce.set_defaults(run=_run_reproduce)
    return parser


def _run_demo(options: argparse.Namespace) -> None:
    from emacm import demo  # imported here, so that --help and --version answer at once
    from emacm.displays.drawing import pyplot

    pyplot()  # a missing matplotlib is stated before the search
    options.out.mkdir(parents=True, exist_ok=True)
    demo.simulated_demo(options.out)


def _run_reproduce(options: argparse.Namespace) -> None:
    folder = Path(__file__).parents[1] / "benchmarks" / "thesis"
    if not folder.is_dir():
        raise FileNotFoundError(
            "the reproduction of the thesis runs in a copy of the repository: benchmarks/thesis."
        )
    sys.argv = [str(folder), *options.others]
    runpy.run_path(str(folder), run_name="__main__")


def _end_workers() -> None:
    """End the worker processes of joblib, if there are any."""
    if "joblib" in sys.modules:
        from joblib.externals.loky import get_reusable_executor

        get_reusable_executor(max_workers=1).shutdown(wait=False, kill_workers=True)


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
