"""The command line: options, exit status, one line for invalid input, and interruptions."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from emacm import __version__
from emacm.__main__ import main

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize(
    "arguments",
    [
        ["score", "none.skops", "x.npz", "--layout", "none.toml"],
        ["trend", ".", ".", "--layout", ".", "--false-alarm", "5 %"],
        ["find", "."],
        ["find", "none.csv", "--bearing", "6205"],
    ],
)
def test_invalid_arguments_are_found_before_libraries_are_imported(arguments):
    libraries = "{'numpy', 'pandas', 'sklearn'}"
    program = f"from emacm.__main__ import main; status = main({arguments!r}); import sys; "
    program += f"sys.exit(9 if {libraries} & set(sys.modules) else status)"
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (found.returncode, found.stderr.count("\n")) == (2, 1), found.stderr


def test_without_matplotlib_the_extra_is_named(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["demo", "--out", str(tmp_path)]) == 2
    assert "install emacm[plot]" in capsys.readouterr().err


def test_the_reproduction_receives_its_options(monkeypatch):
    received = []
    monkeypatch.setattr("sys.argv", ["emacm"])
    monkeypatch.setattr("runpy.run_path", lambda path, run_name: received.extend(sys.argv))
    assert main(["reproduce", "--quick", "--chapter", "2"]) == 0
    assert received == [str(ROOT / "benchmarks" / "thesis"), "--quick", "--chapter", "2"]


def test_the_version_is_printed_under_the_name_of_the_command(capsys, monkeypatch):
    for path, name in (("/bin/emacm", "emacm"), ("/lib/emacm/__main__.py", "python -m emacm")):
        monkeypatch.setattr("sys.argv", [path])
        with pytest.raises(SystemExit) as stopped:
            main(["--version"])
        assert stopped.value.code == 0
        with pytest.raises(SystemExit):
            main(["--help"])
        printed = capsys.readouterr().out
        assert printed.startswith(f"emacm {__version__}\nusage: {name} [-h]")


def test_a_reader_of_the_output_that_has_ended_is_no_error():
    program = (
        "import sys; from emacm.__main__ import main; sys.stdin.read(); sys.exit(main(['schema']))"
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", program], **pipes) as process:
        process.stdout.close()
        process.stdin.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141


def processes_of(group):
    """Return the commands of the living processes of a process group."""
    listed = subprocess.run(
        ["ps", "-e", "-o", "pgid=,stat=,args="], capture_output=True, text=True, check=True
    ).stdout
    rows = [line.split(maxsplit=2) for line in listed.splitlines()]
    return [row[2] for row in rows if row[0] == str(group) and not row[1].startswith("Z")]


BUSY = """
import sys
from joblib import Parallel, delayed
from emacm import demo
from emacm.__main__ import main
task = delayed(exec)("import time; print('busy', flush=True); time.sleep(60)")
demo.simulated_demo = lambda out: Parallel(2)(9 * [task])  # its search begins later
raise SystemExit(main(["demo", "--out", sys.argv[1]]))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals and process groups of POSIX")
@pytest.mark.parametrize(
    ("number", "whole_group"), [(signal.SIGTERM, False), (signal.SIGINT, True)]
)
def test_a_signal_ends_everything_with_one_line(number, whole_group, tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-c", BUSY, str(tmp_path)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    assert sorted(process.stdout.read(10)) == sorted("busy\nbusy\n")  # of two workers
    (os.killpg if whole_group else os.kill)(process.pid, number)
    printed, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in printed
    assert printed.count("emacm: interrupted.\n") == 1
    assert printed.endswith("emacm: interrupted.\n")
    deadline = time.monotonic() + 20
    while processes_of(process.pid) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert processes_of(process.pid) == []
