"""Facts about the package itself: which subpackage may import which, and what an import costs."""

import ast
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import emacm

FOLDER = Path(emacm.__file__).parent

# A subpackage, or a module at the root, imports only from itself and from those above it.
ORDER = [
    "_version",
    "_checks",
    "_statements",
    "_saved",
    "_kernels",
    "shaft",
    "recordings",
    "files",
    "envelopes",
    "findings",
    "resampling",
    "orders",
    "stroke_features",
    "machine",
    "calibration",
    "decisions",
    "conditions",
    "evaluation",
    "explanations",
    "alarms",
    "life",
    "streams",
    "history",
    "monitoring",
    "models",
    "simulation",
    "datasets",
    "displays",
    "reports",
    "verification",
    "export",
    "demo",
    "commands",
    "__main__",
]
NEVER_IMPORTED = {"demo", "commands", "__main__"}  # except by the command line
OPTIONAL = {"matplotlib", "numba", "polars", "tqdm"}
OPTIONAL |= {"asammdf", "h5py", "nptdms", "paho", "pyarrow", "pyuff", "skops"}
TEST_TOOLS = {"pytest", "hypothesis", "tests", "IPython", "ipykernel", "nbclient", "nbformat"}
LONGEST_FILE = 600


def module_name(path):
    parts = path.relative_to(FOLDER.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {module_name(path): path for path in sorted(FOLDER.rglob("*.py"))}
MODULES = sorted(set(FILES) - {"emacm"})


@cache
def tree(module):
    return ast.parse(FILES[module].read_text(encoding="utf-8"))


def imported(nodes):
    """Yield the full names that import statements name: 'a.b' and, for from-imports, 'a.b.c'."""
    for node in nodes:
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, "write imports in full"
            for alias in node.names:
                yield f"{node.module}.{alias.name}"


@cache
def imported_anywhere(module):
    return tuple(imported(ast.walk(tree(module))))


@cache
def imported_at_once(module):
    """Return what is imported when the module is, that is, outside of functions."""

    def outside(node):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
                continue
            if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
                continue
            yield child
            yield from outside(child)

    return tuple(imported(outside(tree(module))))


def place(name):
    """Return the subpackage, or the module at the root, of a full name; a command is a command."""
    return "__main__" if name.endswith(".__main__") else name.split(".")[1]


def of_the_package(names):
    return {name for name in names if name.startswith("emacm.") and place(name) in ORDER}


def test_every_module_has_its_place_in_the_order():
    assert {place(module) for module in MODULES} == set(ORDER)


@pytest.mark.parametrize(
    ("page", "row"),
    [
        ("CONTRIBUTING.md", r"^\| (`.*?) \|"),
        ("notebooks/layers.svg", r'class="name"[^>]*>(.*?)</text>'),
    ],
)
def test_the_pages_list_the_subpackages_in_this_order(page, row):
    text = (FOLDER.parent / page).read_text(encoding="utf-8")
    rows = re.findall(row, text, flags=re.M)
    assert [name.strip("`/") for row in rows for name in row.split(", ")] == ORDER[1:]


def test_a_module_imports_only_from_its_own_subpackage_and_those_above():
    against = {
        (module, name)
        for module in MODULES
        for name in of_the_package(imported_anywhere(module))
        if ORDER.index(place(name)) > ORDER.index(place(module))
    }
    assert not against


def test_only_the_command_line_imports_the_demo():
    importing = {
        (module, name)
        for module in MODULES
        for name in of_the_package(imported_anywhere(module))
        if place(name) in NEVER_IMPORTED and place(name) != place(module)
    }
    assert {place(module) for module, _ in importing} <= {"__main__"}


def test_no_module_imports_itself_by_way_of_others():
    def modules_of(names):
        return {name if name in FILES else name.rpartition(".")[0] for name in names}

    below = {
        module: modules_of(of_the_package(imported_at_once(module))) - {module}
        for module in MODULES
    }
    while below:
        free = [module for module, needed in below.items() if not needed & set(below)]
        assert free, f"a cycle among {sorted(below)}"
        for module in free:
            del below[module]


def test_files_are_short():
    lengths = {
        module: len(path.read_text(encoding="utf-8").splitlines()) for module, path in FILES.items()
    }
    assert {name: n for name, n in lengths.items() if n > LONGEST_FILE} == {}


def git(*arguments):
    """Return the lines that git prints in the repository."""
    if not (FOLDER.parent / ".git").exists():
        pytest.skip("no clone of the repository, but an unpacked sdist")
    command = ["git", *arguments]
    run = subprocess.run(command, cwd=FOLDER.parent, capture_output=True, text=True)
    return run.stdout.splitlines()


def test_the_repository_holds_the_agreed_folders_and_no_others():
    folders = {path.partition("/")[0] for path in git("ls-files") if "/" in path}
    assert folders == {"emacm", "tests", "benchmarks", "notebooks", ".ci", ".github"}


def test_what_readmes_commands_write_is_not_taken_for_a_part_of_the_repository():
    written = ["example/new", "wheels/x.whl", "site/index.html", "emacm_demo/x", ".venv/x"]
    assert git("check-ignore", *written) == written


@pytest.mark.slow
def test_modules_import_nothing_optional_private_or_of_tests():
    names = {(m, name) for m in MODULES for name in imported_anywhere(m)}
    private = {
        (module, name)
        for module, name in names
        if not name.startswith(("emacm.", "__future__"))
        and any(part.startswith("_") for part in name.split("."))
    }
    assert not private
    assert not {(m, name) for m, name in names if name.partition(".")[0] in TEST_TOOLS}
    at_once = {(m, name) for m in MODULES for name in imported_at_once(m)}
    optional = {(m, name) for m, name in at_once if name.partition(".")[0] in OPTIONAL}
    assert {module for module, _ in optional} <= {"emacm._kernels.numba"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "loaded", "not_loaded"),
    [
        ("import emacm", {"emacm"}, {"numpy", "sklearn", "emacm.orders.order_psd"}),
        # pandas imports pyarrow where it is installed.
        ("from emacm import *", {"emacm.orders.order_psd"}, OPTIONAL - {"pyarrow"}),
    ],
)
def test_an_import_imports_no_more_than_it_must(code, loaded, not_loaded):
    code = f"import sys; {code}; print(*sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    found = set(result.stdout.split())
    assert loaded <= found
    assert not not_loaded & found


def test_public_names_come_from_the_modules_that_define_them():
    stub = (FOLDER / "__init__.pyi").read_text(encoding="utf-8")
    for name in set(emacm.__all__) - {"__version__"}:
        module = getattr(emacm, name).__module__.removeprefix("emacm")
        assert f"from {module} import {name} as {name}\n" in stub
        assert name in dir(emacm)


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="nothing"):
        emacm.nothing  # noqa: B018
