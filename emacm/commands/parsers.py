"""Options of the commands on files, checked at once; what a command needs is imported later."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
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
    of_files = (_example, _inspect, _spectrum, _find, _train, _score, _monitor)
    others = (_alarms, _report, _trend, _export, _schema, _describe, _verify)
    for add_options in (*of_files, *others):
        add_options(partial(_command, commands))


Add = Callable[..., Any]
Run = Callable[[argparse.Namespace], Any]


def adder(parser: argparse.ArgumentParser) -> Add:
    """Return a function that adds an option: name, kind, name of its value, and help.

    Several names of one option are separated by spaces. An option of the kind `bool` has no value.
    """

    def add(name: str, kind: Any, value: str | None, text: str, **options: Any) -> None:
        if kind is bool:
            parser.add_argument(name, action="store_true", help=text)
        else:
            parser.add_argument(*name.split(), type=kind, metavar=value, help=text, **options)

    return add


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
    return adder(parser)


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
_jobs = _number(int, "a whole number of at least 1, or -1", lambda n: n >= 1 or n == -1)


def _speed(unit: str = "rpm", *, at_rest: bool = False) -> Callable[[str], float]:
    """Return a function that reads a speed such as "50 rev/s" as a number in a unit.

    A number without a unit is in rpm, in all commands.
    """

    def read(text: str) -> float:
        from emacm.recordings.names import unit_factor

        number, _, stated = text.strip().partition(" ")
        with suppress(ValueError):
            size = unit_factor(stated.strip() or "rpm", "velocity") / unit_factor(unit, "velocity")
            if float(number) > 0 or (at_rest and float(number) == 0):
                return float(number) * size
        expected = f"a speed {'of at least' if at_rest else 'above'} 0, in rpm or as '42 rad/s'"
        raise argparse.ArgumentTypeError(f"expected {expected}, got {text!r}")

    return read


def _share(text: str) -> tuple[int, int]:
    """Return K and N of the text K/N."""
    needed, _, of = text.partition("/")
    if not (needed.isdecimal() and of.isdecimal() and 1 <= int(needed) <= int(of) <= 10):
        raise argparse.ArgumentTypeError(f"expected K/N, 1 <= K <= N <= 10, got {text!r}")
    return int(needed), int(of)


def _example(command: Add) -> None:
    meaning = "write files of a simulated pump, for the examples of README"
    add = command("example", meaning, run=_write_example)
    add("folder", Path, "DIR", "folder, new or empty")


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
    add("file", _existing, "PATH", "a file of measurements, or a folder")
    _add_pattern(add)
    add("--plot", _writable, "PNG", "draw the columns")
    add("--draft", _writable, "TOML", "write a draft of the layout of such files")
    add("--meta", str, "PATTERN", "parts of file names, as '{unit}_{state}_{run:d}'")
    add("--json", bool, None, "JSON on standard output")


def _spectrum(command: Add) -> None:
    add = command(
        "spectrum",
        "order spectrum of files; or an order map, or orders over speed (Bode plot), of one file",
        "0; 2 for invalid arguments; 3 if files failed.",
        _check_spectrum,
    )
    _add_files(add, needs_layout=False)
    add("--channel", str, "C", "channel; default: all, and the first in the picture")
    add("--map", bool, None, "order spectra over time or speed")
    orders = "amplitude and phase of these orders, over time or speed"
    add("--order", _orders, "N,...", orders)
    over = "x axis of --map and --order (default: rpm)"
    add("--over", str, None, over, choices=("rpm", "time"), default="rpm")
    add("--hz", bool, None, "frequency in Hz below: a resonance stays at its frequency")
    _add_parts(add)
    _add_speed(add)
    _add_extent(add, "at least 50")
    add("--plot", _writable, "PNG", "picture")
    add("--csv", _writable, "CSV", "table")
    add("--json", bool, None, "table as JSON on standard output")


def _orders(text: str) -> list[float]:
    """Return the orders of a text such as 1,2,3.5."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected orders, as 1,2,3.5, got {text!r}") from None


def _check_spectrum(options: argparse.Namespace) -> None:
    if options.map and options.order:
        raise ValueError("give --map or --order, not both.")
    if options.order and options.hz:
        raise ValueError("--hz is for a spectrum or a --map; --order is over speed or time.")


def _find(command: Add) -> None:
    add = command(
        "find",
        "name faults of bearings and gears from the geometry, without training",
        "0 if no fault is named; 1 if one is; 2 for invalid arguments; 3 if files have no answer.",
        _check_parts,
    )
    _add_files(add, needs_layout=False)
    _add_parts(add)
    _add_speed(add)
    healthy = "files of this machine without faults; gears, shafts and [orders] need them"
    add("--healthy", _existing, "FOLDER", healthy)
    add("--out", _writable, "CSV", "table with all scores")
    add("--plot", Path, "DIR", "folder for a picture of each finding")
    add("--json", bool, None, "table as JSON on standard output")


def _train(command: Add) -> None:
    add = command("train", "fit a recipe on files, evaluate and save it", check=_check_recipe)
    add("layout", _existing, "LAYOUT", "layout of the files (TOML)")
    add("folder", _existing, "FOLDER", "of the files; with --like, a history")
    _add_pattern(add)
    add("--like", _existing, "MODEL", "fit it again, on features in a history")
    add("--labels", str, "FIELD", "state: a field of the layout's meta", required=True)
    unit = "unit, whose files are held out together: a field of the layout's meta"
    add("--groups", str, "FIELD", unit, required=True)
    recipe = "orders (default): powers in order bins; actuator; bearing: levels of fault lines"
    recipes = ("orders", "actuator", "bearing")
    add("--recipe", str, None, recipe, choices=recipes, default="orders")
    features = "of the recipe orders: powers in orders (default), in third octaves, or both"
    add("--features", str, None, features, choices=("orders", "bands", "both"), default="orders")
    _add_parts(add)
    add("--out", _writable, "MODEL", "file of the model", required=True)
    healthy = "label of the healthy state; default: healthy or normal"
    add("--healthy --healthy-label", str, "LABEL", healthy)
    baseline = "subtract healthy features of each unit or sensor: a field of the layout's meta"
    add("--baseline", str, "FIELD", baseline)
    add("--json", bool, None, "its model card as JSON on standard output")
    _add_extent(add, "20, or more if new units are confused")
    _add_costs(add)
    add("--note", str, "TEXT", "text that is stored in the model file")
    add("--intended-use", str, "TEXT", "what the model is for, for its model card")
    add("--limits", str, "TEXT", "what the model is not for, for its model card")
    _add_jobs(add, "folds")


def _score(command: Add) -> None:
    add = command(
        "score",
        "apply a model to files; one row for each, also for those that cannot be read",
        "0 if all files were decided on; 1 if a decision of --fail-on was made, even if files "
        "failed; 2 for invalid arguments; 3 if files failed (rows state why); 130 if interrupted.",
    )
    _add_model(add)
    _add_files(add)
    healthy = "healthy files of new units, of a model with --baseline; --bearing checks them"
    add("--healthy", _existing, "FOLDER", healthy)
    table = "table (.csv, .jsonl) or history (.sqlite) to go on; default: CSV, printed"
    add("--out", _writable, "FILE", table)
    add("--json", bool, None, "lines of JSON, not CSV, on standard output")
    add("--features", bool, None, "store features in the history, for train --like")
    _add_jobs(add, "files")
    _add_costs(add)
    add("--fail-on", str, "STATE,...", "decisions that give exit status 1", default="")
    add("--watch", _above_zero, "SECONDS", "look for new files so often")
    add("--again", bool, None, "decide again on files that are in the table")
    add("--report", Path, "DIR", "write maintenance reports into this folder")
    _add_report_options(add)


def _monitor(command: Add) -> None:
    add = command(
        "monitor",
        "apply a model to rows of numbers while they are measured; records as JSON lines",
        "0 if all rows were processed; 2 for invalid arguments; 3 if rows were skipped (a line "
        "states why); 130 if it was interrupted.",
    )
    _add_model(add)
    add("source", str, "FILE", "text file that grows; - for the standard input")
    add("--layout", _existing, "L", "layout of the rows (TOML)", required=True)
    highest = "highest speed of the shaft [rpm], or with its unit, as '70 rev/s'"
    add("--max-speed", _speed("rad/s"), "RPM", highest, required=True)
    add("--every", _above_zero, "N", "length of a reading; default: all rows")
    units = ("revolutions", "s")
    add("--unit", str, None, "unit of --every", choices=units, default="revolutions")
    add("--state", Path, "FILE", "state, from which an interrupted run goes on")
    idle = "end when the file has not grown for so long [s]; default: never"
    add("--idle", float, "SECONDS", idle, default=float("inf"))
    add("--name", str, "UNIT", "the unit, or machine; default: name of FILE")
    start = "time at which the first row was measured, if the rows have no dates; default zone: UTC"
    add("--start", datetime.fromisoformat, "TIME", start)
    sink = "FILE.sqlite, influx:FILE, prometheus:FILE.prom or mqtt://[user@]host[:port]/topic"
    add("--sink", str, "SINK", sink, action="append", default=[])
    add("--page", Path, "DIR", "folder of fleet.html, the page of all units")
    add("--keep-alarms", _count, "N", "keep signals of N readings up to alarms")
    folder = "folder of these signals (default: evidence)"
    add("--evidence", Path, "DIR", folder, default=Path("evidence"))
    # When an alarm is raised and cleared.
    add("--healthy", str, "LABEL", "decision without alarm; default: healthy or normal")
    accepted = "accepted false alarms in 1000 operating hours, from which the rest follows"
    add("--false-alarms", _above_zero, "N", accepted, default=1.0)
    after = "raise an alarm after K of N readings; default: as --false-alarms needs, of 5"
    add("--alarm-after", _share, "K/N", after)
    clear = "clear it after so many readings without a reason (default: 5)"
    add("--clear-after", _count, "M", clear, default=5)
    slow = "no alarms up to this speed of the shaft [rpm]"
    add("--min-speed", _speed("rad/s", at_rest=True), "RPM", slow, default=0.0)
    add("--quiet", float, "SECONDS", "and for so long after it does", default=0.0)


def _alarms(command: Add) -> None:
    add = command(
        "alarms",
        "list the open alarms of a history, after acknowledging or suppressing one",
        "0; 1 if an alarm is raised that is not acknowledged or suppressed; 2 for invalid "
        "arguments.",
        _check_name,
    )
    add("history", _existing, "HISTORY", "file of --sink FILE.sqlite")
    add("--all", bool, None, "list also those that are cleared")
    add("--ack", str, "ID", "state that somebody takes care of this alarm")
    add("--suppress", str, "ID", "ignore this alarm until it is cleared")
    add("--by", str, "NAME", "who does")


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
    _add_model(add)
    _add_files(add)
    add("--out", Path, "DIR", "folder, or one .html file", default=Path("report"))
    add("--json", bool, None, "table as JSON on standard output")
    add("--history", _existing, "FILE", "table of earlier results of emacm score")
    add("--healthy", _existing, "FOLDER", "files of this machine without faults, to compare with")
    _add_costs(add)
    _add_report_options(add)


def _trend(command: Add) -> None:
    add = command(
        "trend",
        "distance from healthy files over time: of order bins, or of the lines of bearings",
        "0; 1 if --fail-on-alarm is given and the latest recording of a unit exceeds its limit (if "
        "times are not known, any of them); 2 for invalid arguments; 3 if files failed.",
    )
    add("healthy", _existing, "HEALTHY", "folder of healthy files")
    _add_files(add, needs_layout=False)
    groups = "run of a healthy file: a field of the layout's meta; default: each is a run"
    add("--groups", str, "FIELD", groups)
    _add_parts(add)
    _add_speed(add)
    _add_unit_and_time(add)
    add("--false-alarm", _probability, "P", "rate (default: 0.05)", default=0.05)
    add("--out", _writable, "CSV", "table (default: standard output)")
    add("--plot", _writable, "PNG", "draw the trend of each unit")
    machine = "for zones of RMS vibration: 'group 2 rigid' of ISO 20816-3, 'class I' of 10816-1"
    add("--machine", str, "CLASS", machine)
    add("--json", bool, None, "table as JSON on standard output")
    add("--fail-on-alarm", bool, None, "exit status 1 if a unit exceeds its limit")
    _add_extent(add, "20")


def _export(command: Add) -> None:
    add = command("export", "write a model as C99 sources for the controller of a machine")
    _add_model(add)
    folder = "folder of the sources, of a check against Python, and of their README"
    add("--c", Path, "FOLDER", folder, required=True)
    rate = "sampling rate of the channels and the velocity [Hz]"
    add("--fs", _above_zero, "N", rate, required=True)
    add("--channels", str, "A,B,...", "order of the channels of a sample")
    fastest = "highest speed of the shaft [rpm]; default: 1.1 times that of the training"
    add("--max-speed", _speed("rad/s"), "RPM", fastest)
    every = "revolutions of a reading; default: those of the shortest recording of the training"
    add("--every", float, "N", every)
    kinds = ("float32", "float64")
    add("--precision", str, None, "float or double", choices=kinds, default="float32")


def _describe(command: Add) -> None:
    meaning = "print the model card of a model file, without loading the model"
    add = command("describe", meaning, run=_print_card)
    _add_model(add)
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
    add("model", _existing, "MODEL", model, nargs="?")
    add("--layout", _existing, "L", "layout of the files (TOML)")
    add("--data", _existing, "FOLDER", "folder of the training files")
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


def _add_model(add: Add) -> None:
    add("model", _existing, "MODEL", "file of emacm train or emacm.save_model")


def _add_record(add: Add) -> None:
    """Add where a record is written."""
    add("--out", _record, "FILE", "write it into a file (.txt, .json or .html)")
    add("--json", bool, None, "JSON on standard output")


def _record(text: str) -> Path:
    """Return the path of a file for a record of a known kind."""
    if not text.endswith((".txt", ".json", ".html")):
        raise argparse.ArgumentTypeError(f"{text!r} must end with .txt, .json or .html")
    return _writable(text)


def _add_files(add: Add, *, needs_layout: bool = True) -> None:
    """Add the files that a command reads, and their layout."""
    kind = Path if needs_layout else _existing  # of others, one that is gone has a row or a page
    add("paths", kind, "PATH", "files, or folders of files", nargs="+")
    default = "" if needs_layout else "; default: a draft that leaves nothing open"
    layout = f"layout of the files (TOML){default}"
    add("--layout", _existing, "L", layout, required=needs_layout)
    _add_pattern(add)


def _add_pattern(add: Add) -> None:
    add("--pattern", str, "GLOB", "which files of folders, as '*_vib.csv'", default="**/*")


def _add_parts(add: Add) -> None:
    """Add the parts of the machine."""
    bearing = "designation such as 6205, or balls,ball diameter,pitch diameter[,angle in degrees]"
    add("--bearing", str, "B", bearing)
    parts = (
        "components: [[Bearing]] with designation, or n_balls, ball_diameter, pitch_diameter; "
        "[[Gear]] with teeth, mating_teeth, and ratio of its shaft; [orders], as imbalance = 1.0"
    )
    add("--parts", _existing, "TOML", parts)


def _add_speed(add: Add) -> None:
    text = "constant speed [rpm], or with its unit, in place of that of the files"
    add("--speed", _speed(), "RPM", text)


def _check_parts(options: argparse.Namespace) -> None:
    if not (options.bearing or options.parts):
        raise ValueError(
            "the parts are not known: give --bearing 6205 (or 9,7.94,39.04), or --parts FILE."
        )


def _check_recipe(options: argparse.Namespace) -> None:
    if options.recipe == "bearing":
        _check_parts(options)
    if options.features != "orders" and options.recipe != "orders":
        raise ValueError(f"--features {options.features} is for --recipe orders only.")
    if options.baseline and options.like:
        raise ValueError("--like keeps the features of its model: leave --baseline out.")


def _add_unit_and_time(add: Add) -> None:
    add("--unit", str, "FIELD", "unit: a field of the layout's meta")
    add("--time", str, "FIELD", "time: a field of the layout's meta; default: of the file")


def _add_costs(add: Add) -> None:
    add("--cost", _existing, "CSV", "costs: rows are decisions, columns truths")
    add("--priors", str, "P", "'uniform', or as in healthy=0.9,inner=0.04,outer=0.06")


def _add_extent(add: Add, otherwise: str) -> None:
    """Add the range of the order spectra."""
    orders = f"highest order; default: 4 times that of the parts, or {otherwise}, if files have it"
    add("--max-order", _above_zero, "N", orders)
    length = "revolutions per segment; default: half of the shortest recording, at most 16"
    add("--revolutions", _above_zero, "N", length)
    rest = "the shaft is at rest up to this speed [rpm]"
    add("--min-speed", _speed("rad/s", at_rest=True), "RPM", rest, default=0.0)


def _add_report_options(add: Add) -> None:
    """Add what the reports of ``emacm report`` and ``emacm score`` have in common."""
    add("--actions", _existing, "TOML", "for each decision: decision = 'text'")
    _add_parts(add)
    _add_unit_and_time(add)


def _add_jobs(add: Add, what: str) -> None:
    """Add how many of something run in parallel."""
    text = f"{what} in parallel; -1: one per core (default: 1)"
    add("--jobs", _jobs, "N", text, default=1)
