"""Options of the commands on files, checked at once; what a command needs is imported later."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any


def add_parsers(commands: Any) -> None:
    """Add the commands on files to the command line.

    Parameters
    ----------
    commands : action of `argparse`
        The subcommands.
    """
    methods = (_example, _inspect, _find, _train, _score, _monitor, _alarms, _report, _trend)
    for add_options in (*methods, _schema, _describe, _verify):
        add_options(partial(_command, commands))


Add = Callable[..., Any]
Run = Callable[[argparse.Namespace], Any]


def _command(
    commands: Any,
    name: str,
    meaning: str,
    statuses: str | None = None,
    check: Run = lambda options: None,
    run: Run | None = None,
) -> Add:
    """Add a command, whose module is imported when it runs; return what adds its options.

    What `check` states of the options together is known before these imports, which take seconds.
    """
    status = f"Exit status: {statuses}" if statuses else None
    parser = commands.add_parser(name, help=meaning, description=f"{meaning}.", epilog=status)

    def run_checked(options: argparse.Namespace) -> Any:
        check(options)
        return (run or import_module(f"emacm.commands.{name}").run)(options)

    parser.set_defaults(run=run_checked)
    return parser.add_argument


def _writable(text: str) -> Path:
    """Return the path of a file that can be written when the command ends."""
    path = Path(text)
    if not path.parent.is_dir():
        raise argparse.ArgumentTypeError(f"there is no folder {str(path.parent)!r}")
    if path.is_dir():
        raise argparse.ArgumentTypeError(f"{text!r} is a folder; name a file")
    return path


def _existing(text: str) -> Path:
    """Return the path of a file or folder that is there.

    Raises
    ------
    FileNotFoundError
        If it is not; also while arguments are parsed, this is one line for the user.
    """
    path = Path(text)
    if not path.exists():
        raise FileNotFoundError(f"there is no file {text!r}.")
    return path


def _number(kind: type, expected: str, is_valid: Callable[[Any], bool]) -> Callable[[str], Any]:
    """Return a function that reads a valid number from a text."""

    def read(text: str) -> Any:
        with suppress(ValueError):
            if is_valid(kind(text)):
                return kind(text)
        raise argparse.ArgumentTypeError(f"expected {expected}, got {text!r}")

    return read


_above_zero = _number(float, "a number above 0", lambda number: number > 0)  # also infinity
_probability = _number(float, "a number above 0 and below 1", lambda number: 0 < number < 1)
_count = _number(int, "a whole number of at least 1", lambda number: number >= 1)
_jobs = _number(
    int,
    "a whole number of at least 1, or -1 for one per core",
    lambda number: number >= 1 or number == -1,
)


def _share(text: str) -> tuple[int, int]:
    """Return K and N of the text K/N."""
    needed, _, of = text.partition("/")
    if not (needed.isdecimal() and of.isdecimal() and 1 <= int(needed) <= int(of) <= 10):
        raise argparse.ArgumentTypeError(f"expected K/N, 1 <= K <= N <= 10, got {text!r}")
    return int(needed), int(of)


def _time(text: str) -> datetime:
    """Return a date with its time, in UTC if it has no zone."""
    time = datetime.fromisoformat(text)
    return time if time.tzinfo else time.replace(tzinfo=UTC)


def _example(command: Add) -> None:
    meaning = "write files of a simulated pump, for the examples of README"
    add = command("example", meaning, run=_write_example)
    add("folder", metavar="DIR", type=Path, help="folder, new or empty")


def _write_example(options: argparse.Namespace) -> None:
    from emacm.simulation.example_files import write_example

    for path in write_example(options.folder):
        print(path)


def _inspect(command: Add) -> None:
    add = command(
        "inspect",
        "list the columns of a file, or the files of a folder, with rates, units and duration",
        "0; 2 for invalid arguments or a file that cannot be read; 3 if files of a folder cannot.",
    )
    add("file", metavar="PATH", type=_existing, help="a file of measurements, or a folder")
    _add_pattern(add)
    add("--plot", type=_writable, metavar="PNG", help="draw the columns")
    add("--draft", type=_writable, metavar="TOML", help="write a draft of the layout of such files")
    add("--meta", metavar="PATTERN", help="parts of file names, as '{unit}_{state}_{run:d}'")


def _find(command: Add) -> None:
    add = command(
        "find",
        "name faults of bearings and gears from the geometry, without training",
        "0 if no fault is named; 1 if one is; 2 for invalid arguments; 3 if files have no answer.",
        _check_parts,
    )
    _add_files(add, needs_layout=False)
    _add_parts(add)
    add("--speed", type=_above_zero, metavar="RPM", help="constant speed, not that of the files")
    add("--healthy", type=_existing, metavar="FOLDER", help="files of this machine without faults")
    add("--out", type=_writable, metavar="CSV", help="table with all scores")
    add("--plot", type=Path, metavar="DIR", help="folder for a picture of each finding")


def _train(command: Add) -> None:
    add = command("train", "fit a recipe on files, evaluate and save it", check=_check_recipe)
    add("layout", metavar="LAYOUT", type=_existing, help="layout of the files (TOML)")
    add("folder", metavar="FOLDER", type=_existing, help="of the files; with --like, a history")
    _add_pattern(add)
    add("--like", type=_existing, metavar="MODEL", help="fit it again, on features in a history")
    add("--labels", required=True, metavar="FIELD", help="state: a field of the layout's meta")
    add("--groups", required=True, metavar="FIELD", help="unit, held out as a whole: such a field")
    recipe = "orders (default): powers in order bins; actuator; bearing: levels of fault lines"
    add("--recipe", choices=("orders", "actuator", "bearing"), default="orders", help=recipe)
    _add_parts(add)
    add("--out", required=True, type=_writable, metavar="MODEL", help="file of the model")
    add("--healthy", metavar="LABEL", help="label of the healthy state; default: healthy or normal")
    _add_extent(add)
    _add_costs(add)
    add("--note", metavar="TEXT", help="text that is stored in the model file")
    add("--intended-use", metavar="TEXT", help="what the model is for, for its model card")
    add("--limits", metavar="TEXT", help="what the model is not for, for its model card")
    add_jobs(add, "folds")


def _score(command: Add) -> None:
    add = command(
        "score",
        "apply a model to files; one row for each, also for those that cannot be read",
        "0 if all files were decided on; 1 if a decision of --fail-on was made; 2 for invalid "
        "arguments; 3 if files failed (their rows state why); 130 if it was interrupted.",
    )
    add("model", metavar="MODEL", type=_existing, help="file of emacm.save_model")
    _add_files(add)
    table = "table (.csv, .jsonl, .parquet) or history (.sqlite) to go on; default: CSV, printed"
    add("--out", type=_writable, metavar="FILE", help=table)
    add("--features", action="store_true", help="store features in the history, for train --like")
    add_jobs(add, "files")
    _add_costs(add)
    add("--fail-on", default="", metavar="STATE,...", help="decisions that give exit status 1")
    add("--watch", type=_above_zero, metavar="SECONDS", help="look for new files so often")
    add("--again", action="store_true", help="decide again on files that are in the table")
    add("--report", type=Path, metavar="DIR", help="write maintenance reports into this folder")
    _add_report_options(add)


def _monitor(command: Add) -> None:
    add = command(
        "monitor",
        "apply a model to rows of numbers while they are measured; records as JSON lines",
        "0 if all rows were processed; 2 for invalid arguments; 3 if rows were skipped (a line "
        "states why); 130 if it was interrupted.",
    )
    add("model", metavar="MODEL", type=_existing, help="file of emacm.save_model")
    add("source", metavar="FILE", help="text file that grows; - for the standard input")
    add("--layout", required=True, type=_existing, metavar="L", help="layout of the rows (TOML)")
    add("--max-speed", required=True, type=_above_zero, metavar="N", help="highest speed [rad/s]")
    add("--every", type=_above_zero, metavar="N", help="length of a reading; default: all rows")
    add("--unit", choices=("revolutions", "s"), default="revolutions", help="unit of --every")
    add("--wrapped", action="store_true", help="the angle is wrapped at 2 pi (or 360 degrees)")
    add("--state", type=Path, metavar="FILE", help="state, from which an interrupted run goes on")
    idle = "end when the file has not grown for so long [s]; default: never"
    add("--idle", type=float, default=float("inf"), metavar="SECONDS", help=idle)
    add("--name", metavar="UNIT", help="the unit, or machine; default: name of FILE")
    start = "time at which the first row was measured, if the rows have no dates; default zone: UTC"
    add("--start", type=_time, metavar="TIME", help=start)
    sink = "FILE.sqlite, influx:FILE, prometheus:FILE.prom or mqtt://[user@]host[:port]/topic"
    add("--sink", action="append", default=[], metavar="SINK", help=sink)
    add("--page", type=Path, metavar="DIR", help="folder of fleet.html, the page of all units")
    add("--keep-alarms", type=_count, metavar="N", help="keep signals of N readings up to alarms")
    folder = "folder of these signals (default: evidence)"
    add("--evidence", type=Path, default=Path("evidence"), metavar="DIR", help=folder)
    _add_alarms(add)


def _add_alarms(add: Add) -> None:
    """Add when an alarm is raised and cleared."""
    add("--healthy", metavar="LABEL", help="decision without alarm; default: healthy or normal")
    accepted = "accepted false alarms in 1000 operating hours, from which the rest follows"
    add("--false-alarms", type=_above_zero, default=1.0, metavar="N", help=accepted)
    after = "raise an alarm after K of N readings; default: as --false-alarms needs, of 5"
    add("--alarm-after", type=_share, metavar="K/N", help=after)
    clear = "clear it after so many readings without a reason (default: 5)"
    add("--clear-after", type=_count, default=5, metavar="M", help=clear)
    slow = "no alarms while the shaft does not exceed this speed [rad/s]"
    add("--min-speed", type=float, default=0.0, metavar="N", help=slow)
    add("--quiet", type=float, default=0.0, metavar="SECONDS", help="and for so long after it does")


def _alarms(command: Add) -> None:
    add = command(
        "alarms",
        "list the open alarms of a history, after acknowledging or suppressing one",
        "0; 1 if an alarm is raised that is not acknowledged or suppressed; 2 for invalid "
        "arguments.",
        _check_name,
    )
    add("history", metavar="HISTORY", type=_existing, help="file of --sink FILE.sqlite")
    add("--all", action="store_true", help="list also those that are cleared")
    add("--ack", metavar="ID", help="state that somebody takes care of this alarm")
    add("--suppress", metavar="ID", help="ignore this alarm until it is cleared")
    add("--by", metavar="NAME", help="who does")


def _check_name(options: argparse.Namespace) -> None:
    if (options.ack or options.suppress) and not options.by:
        raise ValueError("--ack and --suppress need --by NAME: state who decided this.")


def _schema(command: Add) -> None:
    meaning = "print the JSON Schema of the records of score and monitor"
    command("schema", meaning, run=_print_schema)


def _print_schema(options: argparse.Namespace) -> None:
    from emacm.history.records import SCHEMA

    print(json.dumps(SCHEMA, indent=2))


def _report(command: Add) -> None:
    add = command("report", "write maintenance reports of files, an HTML page for each")
    add("model", metavar="MODEL", type=_existing, help="file of emacm.save_model")
    _add_files(add)
    add("--out", type=Path, default=Path("report"), metavar="DIR", help="folder, or one .html file")
    add("--history", type=_existing, metavar="FILE", help="table of earlier results of emacm score")
    _add_report_options(add)


def _trend(command: Add) -> None:
    add = command(
        "trend",
        "distance from healthy files over time: of order bins, or of lines of --bearing or --parts",
        "0; 1 if --fail-on-alarm is given and the latest recording of a unit exceeds its limit; 2 "
        "for invalid arguments; 3 if files failed.",
    )
    add("healthy", metavar="HEALTHY", type=_existing, nargs="?", help="folder of healthy files")
    _add_files(add, "*")
    add("--groups", metavar="FIELD", help="run of a healthy file: a field of the layout's meta")
    results = "table of emacm score, not files; the index is -log10 of P(healthy) or typicality"
    add("--results", type=_existing, metavar="TABLE", help=results)
    add("--state", metavar="LABEL", help="healthy state in TABLE; default: healthy or normal")
    add("--unit", metavar="FIELD", help="unit: a field of the layout's meta")
    _add_parts(add)
    _add_time(add)
    add("--false-alarm", type=_probability, default=0.05, metavar="P", help="rate (default: 0.05)")
    add("--out", type=_writable, metavar="CSV", help="table (default: standard output)")
    add("--plot", type=_writable, metavar="PNG", help="draw the trend of each unit")
    machine = "for zones of RMS velocity: 'group 2 rigid' of ISO 20816-3, 'class I' of 10816-1"
    add("--machine", metavar="CLASS", help=machine)
    add("--fail-on-alarm", action="store_true", help="exit status 1 if a unit exceeds its limit")
    _add_extent(add)


def _describe(command: Add) -> None:
    meaning = "print the model card of a model file, without loading the model"
    add = command("describe", meaning, run=_print_card)
    add("model", metavar="MODEL", type=_existing, help="file of emacm train or emacm.save_model")
    _add_record(add)


def _print_card(options: argparse.Namespace) -> None:
    from emacm.reports.model_cards import describe_model
    from emacm.reports.written_pages import written_record

    card = describe_model(options.model)
    print(written_record(card, options.out, as_json=options.json) or f"Model card: {options.out}")


def _verify(command: Add) -> None:
    add = command(
        "verify",
        "compute known answers of the field on this computer; or the evaluation of a model again",
        "0 if all are within their tolerance; 1 if one is not; 2 for invalid arguments.",
        _check_verify,
        _run_verify,
    )
    model = "file of emacm train, whose figures are computed again from --data"
    add("model", metavar="MODEL", type=_existing, nargs="?", help=model)
    add("--layout", type=_existing, metavar="L", help="layout of the files (TOML)")
    add("--data", type=_existing, metavar="FOLDER", help="folder of the training files")
    _add_record(add)


def _check_verify(options: argparse.Namespace) -> None:
    if len({options.model is None, options.layout is None, options.data is None}) > 1:
        raise ValueError("give MODEL, --layout and --data together, or none of them.")


def _run_verify(options: argparse.Namespace) -> int:
    from emacm.files.folder import RecordingFolder
    from emacm.files.layout import Layout
    from emacm.models.model_files import model_description
    from emacm.reports.written_pages import written_record
    from emacm.verification.record import verify, verify_model

    if options.model is None:
        found = verify()
    else:
        evidence = model_description(options.model).get("evidence") or {}
        layout, pattern = Layout.from_toml(options.layout), evidence.get("pattern") or "**/*"
        found = verify_model(options.model, RecordingFolder(options.data, layout, pattern))
    text = written_record(found, options.out, as_json=options.json)
    print(text or f"{found.summary}: {options.out}")
    return 0 if found.passed else 1


def _add_record(add: Add) -> None:
    """Add where a record is written."""
    add("--out", type=_record, metavar="FILE", help="write it into a file (.txt, .json or .html)")
    add("--json", action="store_true", help="JSON on standard output")


def _record(text: str) -> Path:
    """Return the path of a file for a record of a known kind."""
    if not text.endswith((".txt", ".json", ".html")):
        raise argparse.ArgumentTypeError(f"{text!r} must end with .txt, .json or .html")
    return _writable(text)


def _add_files(add: Add, number: str = "+", *, needs_layout: bool = True) -> None:
    """Add the files that a command reads, and their layout."""
    kind = Path if needs_layout else _existing  # of others, one that is gone has a row or a page
    add("paths", metavar="PATH", type=kind, nargs=number, help="files, or folders of files")
    default = "" if needs_layout else "; default: a draft that leaves nothing open"
    layout = f"layout of the files (TOML){default}"
    add("--layout", required=needs_layout, type=_existing, metavar="L", help=layout)
    _add_pattern(add)


def _add_pattern(add: Add) -> None:
    """Add which files of folders are read."""
    add("--pattern", default="**/*", metavar="GLOB", help="which files of folders, as '*_vib.csv'")


def _add_parts(add: Add) -> None:
    """Add the parts of the machine."""
    bearing = "designation such as 6205, or balls,ball diameter,pitch diameter[,contact angle]"
    add("--bearing", metavar="B", help=bearing)
    parts = "components: tables such as [[Bearing]] with n_balls, ball_diameter, pitch_diameter"
    add("--parts", type=_existing, metavar="TOML", help=parts)


def _check_parts(options: argparse.Namespace) -> None:
    if not (options.bearing or options.parts):
        raise ValueError(
            "the parts are not known: give --bearing 6205 (or 9,7.94,39.04), or --parts FILE."
        )


def _check_recipe(options: argparse.Namespace) -> None:
    if options.recipe == "bearing":
        _check_parts(options)
    elif options.bearing or options.parts:
        raise ValueError(
            f"--recipe {options.recipe} has no use for --bearing and --parts. Leave them out."
        )


def _add_time(add: Add) -> None:
    """Add where the time of a recording is."""
    add("--time", metavar="FIELD", help="time: a field of the layout's meta; default: of the file")


def _add_costs(add: Add) -> None:
    """Add costs and priors."""
    add("--cost", type=_existing, metavar="CSV", help="costs: rows are decisions, columns truths")
    add("--priors", metavar="P", help="'uniform', or as in healthy=0.9,inner=0.04,outer=0.06")


def _add_extent(add: Add) -> None:
    """Add the range of the order spectra."""
    orders = "highest order; default: what all recordings support, at most 20"
    add("--max-order", type=_above_zero, metavar="N", help=orders)
    length = "revolutions per segment; default: half of the shortest recording, at most 16"
    add("--revolutions", type=_above_zero, metavar="N", help=length)
    add("--min-speed", type=float, default=0.0, metavar="N", help="at rest up to this [rad/s]")


def _add_report_options(add: Add) -> None:
    """Add what the reports of ``emacm report`` and ``emacm score`` have in common."""
    add("--actions", type=_existing, metavar="TOML", help="for each decision: decision = 'text'")
    _add_parts(add)
    add("--unit", metavar="FIELD", help="unit: a field of the layout's meta")
    _add_time(add)


def add_jobs(add: Add, what: str, default: int = 1) -> None:
    """Add how many of something run in parallel."""
    text = f"{what} in parallel; -1: one per core (default: {default})"
    add("--jobs", type=_jobs, default=default, metavar="N", help=text)
