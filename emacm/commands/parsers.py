"""Options of the commands on files. What a command needs is imported when it runs."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from emacm.files.folder import recording_files


def expanded(paths: Sequence[Path]) -> list[Path]:
    """Return files, and in place of folders the files in them, sorted."""
    found: list[Path] = []
    for path in paths:
        found += sorted(recording_files(path)) if path.is_dir() else [path]
    return list(dict.fromkeys(found))


def check_paths(paths: Sequence[Path]) -> None:
    """Raise a ValueError if a folder has no file of a known type."""
    for path in paths:
        if path.is_dir() and next(recording_files(path), None) is None:
            raise ValueError(f"the folder {str(path)!r} has no file of a known type.")


def add_parsers(commands: Any) -> None:
    """Add the commands on files to the command line.

    Parameters
    ----------
    commands : action of `argparse`
        The subcommands.
    """
    _add_inspect(commands)
    _add_train(commands)
    _add_score(commands)
    _add_monitor(commands)
    _add_report(commands)
    _add_trend(commands)


def _writable(text: str) -> Path:
    """Return the path of a file that can be written when the command ends."""
    path = Path(text)
    if not path.parent.is_dir():
        raise argparse.ArgumentTypeError(f"there is no folder {str(path.parent)!r}")
    return path


def _run_later(name: str) -> Callable[[argparse.Namespace], int]:
    """Return the function of a command, whose module is imported when it runs."""
    return lambda options: import_module(f"emacm.commands.{name}").run(options)


def _add_inspect(commands: Any) -> None:
    """Add ``emacm inspect``."""
    parser = commands.add_parser(
        "inspect", help="list the columns of a file, with rates, units, duration and range"
    )
    parser.set_defaults(run=_run_later("inspect"))
    parser.add_argument("file", metavar="FILE", type=Path, help="a file of measurements")
    parser.add_argument("--plot", type=_writable, metavar="PNG", help="draw the columns")
    parser.add_argument(
        "--draft", type=_writable, metavar="TOML", help="write a draft of the layout of such files"
    )


def _add_train(commands: Any) -> None:
    """Add ``emacm train``."""
    parser = commands.add_parser(
        "train", help="fit a recipe on the files of a folder, evaluate it, and save the model"
    )
    parser.set_defaults(run=_run_later("train"))
    parser.add_argument("layout", metavar="LAYOUT", type=Path, help="layout of the files (TOML)")
    parser.add_argument("folder", metavar="FOLDER", type=Path, help="folder of the files")
    parser.add_argument(
        "--labels", required=True, metavar="KEY", help="key of meta with the state of the machine"
    )
    parser.add_argument(
        "--groups",
        required=True,
        metavar="KEY",
        help="key of meta with the unit or run; the evaluation leaves out whole ones",
    )
    parser.add_argument(
        "--recipe",
        choices=("orders", "actuator"),
        default="orders",
        help="orders: powers in order bins (default); actuator: emacm.actuator_recipe",
    )
    parser.add_argument(
        "--out", required=True, type=_writable, metavar="MODEL", help="file of the model"
    )
    parser.add_argument(
        "--healthy", metavar="LABEL", help="label of the healthy state; default: healthy or normal"
    )
    _add_extent(parser)
    parser.add_argument("--cost", type=Path, metavar="CSV", help="costs, as for score")
    parser.add_argument("--priors", metavar="P", help="priors, as for score")
    parser.add_argument("--note", metavar="TEXT", help="text that is stored in the model file")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="folds in parallel")


def _add_files(parser: argparse.ArgumentParser, number: str = "+") -> None:
    """Add the files that a command reads, and their layout."""
    parser.add_argument(
        "paths", metavar="PATH", type=Path, nargs=number, help="files, or folders of files"
    )
    parser.add_argument(
        "--layout", required=True, type=Path, metavar="L", help="layout of the files (TOML)"
    )


def _add_time(parser: argparse.ArgumentParser) -> None:
    """Add where the time of a recording is."""
    parser.add_argument(
        "--time",
        metavar="KEY",
        help="key of meta with the time of a recording (default: when its file was written)",
    )


def _add_extent(parser: argparse.ArgumentParser) -> None:
    """Add the range of the order spectra."""
    for name, meaning in (
        ("max-order", "highest order; default: what all recordings support, at most 20"),
        (
            "revolutions",
            "revolutions per segment; default: half of the shortest recording, at most 16",
        ),
    ):
        parser.add_argument(f"--{name}", type=float, metavar="N", help=meaning)
    parser.add_argument(
        "--min-speed",
        type=float,
        default=0.0,
        metavar="N",
        help="speed up to which the shaft counts as standing still [rad/s]",
    )


def _add_score(commands: Any) -> None:
    """Add ``emacm score``."""
    parser = commands.add_parser(
        "score",
        help="apply a model to files; one row for each, also for those that cannot be read",
        description="Apply a model to files; one row for each, also for those that cannot be read.",
        epilog="Exit status: 0 if all files were decided on; 1 if a decision of --fail-on was "
        "made; 2 for invalid arguments, model or layout; 3 if files failed (their rows state "
        "why); 130 if it was interrupted.",
    )
    parser.set_defaults(run=_run_later("score"))
    parser.add_argument("model", metavar="MODEL", type=Path, help="file of emacm.save_model")
    _add_files(parser)
    parser.add_argument(
        "--out",
        type=_writable,
        metavar="FILE",
        help="table (.csv, .jsonl or .parquet); files that are in it are not decided on again. "
        "Default: CSV on the standard output",
    )
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="files in parallel")
    parser.add_argument(
        "--cost", type=Path, metavar="CSV", help="costs: a row for each decision, columns: truths"
    )
    parser.add_argument(
        "--priors", metavar="P", help="'uniform', or as in healthy=0.9,inner=0.04,outer=0.06"
    )
    parser.add_argument(
        "--fail-on",
        default="",
        metavar="STATE,...",
        help="exit status 1 if one of these decisions is made",
    )
    parser.add_argument(
        "--watch", type=float, metavar="SECONDS", help="look for new files at this interval [s]"
    )
    parser.add_argument(
        "--again", action="store_true", help="decide again on files that are in the table"
    )
    parser.add_argument(
        "--report", type=Path, metavar="DIR", help="write maintenance reports into this folder"
    )
    _add_report_options(parser)


def _add_report(commands: Any) -> None:
    """Add ``emacm report``."""
    parser = commands.add_parser(
        "report", help="write maintenance reports of files, an HTML page for each"
    )
    parser.set_defaults(run=_run_later("report"))
    parser.add_argument("model", metavar="MODEL", type=Path, help="file of emacm.save_model")
    _add_files(parser)
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("report"),
        metavar="DIR",
        help="folder of the pages, or one file that ends with .html (default: report)",
    )
    parser.add_argument(
        "--history", type=Path, metavar="FILE", help="table of earlier results, of emacm score"
    )
    _add_report_options(parser)


def _add_report_options(parser: argparse.ArgumentParser) -> None:
    """Add what the reports of ``emacm report`` and ``emacm score`` have in common."""
    parser.add_argument(
        "--actions",
        type=Path,
        metavar="TOML",
        help="recommended action for each decision: TOML, decision = 'text'",
    )
    parser.add_argument(
        "--parts",
        type=Path,
        metavar="TOML",
        help="components of the machine: tables such as [[Bearing]] with n_balls, ball_diameter, "
        "pitch_diameter, name; [orders] with BPFI = 5.4",
    )
    parser.add_argument(
        "--unit", metavar="KEY", help="key of meta with the unit, for 'since when' in reports"
    )
    _add_time(parser)


def _add_trend(commands: Any) -> None:
    """Add ``emacm trend``."""
    parser = commands.add_parser(
        "trend",
        help="distance of the files of each unit from healthy ones over time, with a limit",
        epilog="Exit status: 0; 1 if --fail-on-alarm is given and the latest recording of a unit "
        "exceeds its limit; 2 for invalid arguments or too few healthy groups; 3 if files failed.",
    )
    parser.set_defaults(run=_run_later("trend"))
    parser.add_argument(
        "healthy", metavar="HEALTHY", type=Path, nargs="?", help="folder of healthy files"
    )
    _add_files(parser, "*")
    parser.add_argument(
        "--groups",
        metavar="KEY",
        help="key of meta with the run of a healthy file; whole ones are left out for the limit",
    )
    parser.add_argument(
        "--results",
        type=Path,
        metavar="TABLE",
        help="table of emacm score, in place of files, HEALTHY and --groups; the index is -log10 "
        "of P(healthy) or of the typicality, whichever is smaller, and the limit that of "
        "--false-alarm",
    )
    parser.add_argument(
        "--state", metavar="LABEL", help="healthy state in TABLE; default: healthy or normal"
    )
    parser.add_argument("--unit", metavar="KEY", help="key of meta with the unit")
    _add_time(parser)
    parser.add_argument(
        "--false-alarm",
        type=float,
        default=0.05,
        metavar="P",
        help="probability that a healthy recording exceeds the limit (default: 0.05)",
    )
    parser.add_argument(
        "--out", type=_writable, metavar="CSV", help="table (default: standard output)"
    )
    parser.add_argument("--plot", type=_writable, metavar="PNG", help="draw the trend of each unit")
    parser.add_argument(
        "--fail-on-alarm", action="store_true", help="exit status 1 if a unit exceeds its limit"
    )
    _add_extent(parser)


def _add_monitor(commands: Any) -> None:
    """Add ``emacm monitor``."""
    parser = commands.add_parser(
        "monitor",
        help="apply a model to rows of numbers while they are measured; readings as JSON lines",
        description="Apply a model to rows of numbers while they are measured, and print readings "
        "and alarms as JSON lines.",
        epilog="Exit status: 0 if all rows were processed; 2 for invalid arguments, model or "
        "layout; 3 if rows were invalid and skipped (a line states why); 130 if it was "
        "interrupted.",
    )
    parser.set_defaults(run=_run_later("monitor"))
    parser.add_argument("model", metavar="MODEL", type=Path, help="file of emacm.save_model")
    parser.add_argument(
        "source", metavar="FILE", help="text file that grows; - for the standard input"
    )
    parser.add_argument(
        "--layout", required=True, type=Path, metavar="L", help="layout of the rows (TOML)"
    )
    parser.add_argument(
        "--max-speed", required=True, type=float, metavar="N", help="highest speed [rad/s]"
    )
    parser.add_argument(
        "--every", type=float, metavar="N", help="length of a reading; default: one at the end"
    )
    parser.add_argument(
        "--unit", choices=("revolutions", "s"), default="revolutions", help="unit of --every"
    )
    parser.add_argument(
        "--wrapped", action="store_true", help="the angle is wrapped at 2 pi (or 360 degrees)"
    )
    parser.add_argument(
        "--state",
        type=Path,
        metavar="FILE",
        help="file of the state, from which an interrupted run goes on",
    )
    parser.add_argument(
        "--idle",
        type=float,
        default=float("inf"),
        metavar="SECONDS",
        help="end when the file has not grown for so long [s]; default: never",
    )
