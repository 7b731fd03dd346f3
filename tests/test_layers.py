"""Facts about the package itself: who may import whom, and what an import costs."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import emacm

FOLDER = Path(emacm.__file__).parent

# From the ground up. A module imports from lower layers and from its own, never from above.
LAYERS = {
    "checks": ["_checks", "_version"],
    "inner loops": ["_kernels", "_kernels_numba", "_kernels_numpy"],
    "functions on arrays": [
        "axes",
        "bins",
        "blocks",
        "calibration",
        "confounding",
        "costs",
        "cross_spectrum",
        "digests",
        "discriminants",
        "distances",
        "envelope",
        "families",
        "predicted_orders",
        "feature_baselines",
        "fourier",
        "gaussians",
        "group_bootstrap",
        "harmonics",
        "interpolation",
        "levels",
        "machine_parts",
        "moments",
        "motion",
        "opinion_pools",
        "paths",
        "posteriors",
        "priors",
        "profiles",
        "resampling",
        "right_decisions",
        "risks",
        "routed_rows",
        "shaft",
        "shrinkage",
        "spectrum",
        "spreading",
        "stated_costs",
        "strokes",
        "tacho",
    ],
    "recordings": [
        "recordings",
        "angle_recordings",
        "angle_baselines",
        "angle_checks",
        "conditions",
        "envelope_recordings",
        "pair_columns",
        "progress",
        "recalled_spectra",
        "spectrum_store",
        "stroke_signals",
    ],
    "estimators": [
        "baseline_normalizer",
        "bin_transformer",
        "condition_router",
        "diagnosis",
        "envelope_detector",
        "members",
        "order_cross_spectrum",
        "order_psd",
        "order_resampler",
        "posterior_product",
        "recipes",
        "recording_statistics",
        "recording_transformers",
        "relative_harmonics",
        "shaft_harmonics",
        "stroke_features",
        "stroke_profile",
    ],
    "explanations": ["decision_slopes", "explanations", "feature_traces", "opened_pipelines"],
    "evaluation": [
        "evaluation",
        "evaluation_figures",
        "evaluation_remarks",
        "evaluation_results",
        "groupings",
        "held_out_decisions",
        "hold_out",
        "scoring_rules",
    ],
    "simulation": [
        "bench",
        "bench_actuator",
        "bench_conditions",
        "bench_faults",
        "bench_motion",
        "bench_motor",
        "bench_rod",
        "bench_sensors",
        "bench_sets",
        "bench_vibration",
        "chapter3_signals",
        "simple_actuator",
        "simulation",
    ],
    "data": ["datasets"],
    "pictures": [
        "_bin_bars",
        "_drawing",
        "_drawn_tables",
        "bin_displays",
        "component_displays",
        "contribution_displays",
        "decision_displays",
        "displays",
        "evaluation_displays",
        "feature_displays",
        "order_map_displays",
        "outcome_displays",
        "signal_displays",
        "spectrum_displays",
    ],
    "reproduction": [
        "chapter2_classes",
        "chapter2_spectra",
        "chapter3_figures",
        "chapter3_readings",
        "chapter4_control",
        "chapter4_exposure",
        "chapter4_pictures",
        "chapter4_remarks",
        "chapter4_spectra",
        "chapter4_study",
        "chapter4_tables",
        "findings",
        "printed_equations",
        "report",
        "report_folder",
        "reproduce_chapter2",
        "reproduce_chapter3",
        "reproduce_chapter4",
    ],
    "the package": ["__init__"],
    "programs": ["demo", "reproduce", "__main__"],
}
HEIGHT = {name: height for height, names in enumerate(LAYERS.values()) for name in names}
MODULES = sorted(path.stem for path in FOLDER.glob("*.py"))
OPTIONAL = {"matplotlib", "numba", "polars", "tqdm"}


def tree(module):
    return ast.parse((FOLDER / f"{module}.py").read_text(encoding="utf-8"))


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


def imported_anywhere(module):
    return list(imported(ast.walk(tree(module))))


def imported_at_once(module):
    """Yield what is imported when the module is, that is, outside of functions."""

    def outside(node):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
                continue
            if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
                continue
            yield child
            yield from outside(child)

    return list(imported(outside(tree(module))))


def of_the_package(names):
    """Yield the modules of this package among imported names."""
    for name in names:
        first, _, rest = name.partition(".")
        if first == "emacm":
            module = rest.partition(".")[0]
            yield module if module in MODULES else "__init__"


def test_every_module_has_a_layer():
    assert sorted(HEIGHT) == MODULES


def test_no_module_has_two_layers():
    assert len(HEIGHT) == sum(map(len, LAYERS.values()))


@pytest.mark.parametrize("module", MODULES)
def test_no_module_imports_from_a_higher_layer(module):
    above = {
        name for name in of_the_package(imported_anywhere(module)) if HEIGHT[name] > HEIGHT[module]
    }
    assert not above


def test_no_module_imports_itself_by_way_of_others():
    below = {module: set(of_the_package(imported_at_once(module))) for module in MODULES}
    while below:
        free = [module for module, needed in below.items() if not needed & set(below)]
        assert free, f"a circle among {sorted(below)}"
        for module in free:
            del below[module]


@pytest.mark.parametrize("module", LAYERS["checks"] + LAYERS["functions on arrays"])
def test_functions_on_arrays_know_no_estimator(module):
    assert not [name for name in imported_anywhere(module) if name.startswith("sklearn.base")]


@pytest.mark.parametrize("module", sorted(set(MODULES) - {"_kernels_numba"}))
def test_nothing_optional_is_imported_with_a_module(module):
    assert not OPTIONAL & {name.partition(".")[0] for name in imported_at_once(module)}


def test_the_compiled_kernels_are_imported_by_name_alone():
    importing = [m for m in MODULES if "_kernels_numba" in " ".join(imported_anywhere(m))]
    assert not importing


@pytest.mark.parametrize("module", MODULES)
def test_nothing_private_of_another_package_is_imported(module):
    private = [
        name
        for name in imported_anywhere(module)
        if not name.startswith(("emacm.", "__future__"))
        and any(part.startswith("_") for part in name.split("."))
    ]
    assert not private


@pytest.mark.parametrize("module", MODULES)
def test_no_private_attribute_of_scikit_learn_is_reached_through_a_public_module(module):
    names = [name for name in imported_anywhere(module) if name.startswith("sklearn")]
    short = {name.rpartition(".")[2] for name in names} | {"sklearn"}
    private = [
        ast.unparse(node)
        for node in ast.walk(tree(module))
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id in short
        and node.attr.startswith("_")
        and not node.attr.startswith("__")
    ]
    assert not private


@pytest.mark.parametrize("module", MODULES)
def test_no_module_imports_a_test_tool(module):
    tools = {"pytest", "hypothesis", "tests", "IPython", "ipykernel", "nbclient", "nbformat"}
    assert not tools & {name.partition(".")[0] for name in imported_anywhere(module)}


def loaded_by(code):
    """Return the modules that an interpreter has loaded after some code."""
    code = f"import sys; {code}; print(*sys.modules)"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120
    )
    return set(result.stdout.split())


def test_importing_the_package_imports_hardly_anything():
    assert not {"numpy", "sklearn", "emacm.order_psd"} & loaded_by("import emacm")


def test_importing_all_names_imports_nothing_optional():
    loaded = loaded_by("from emacm import *")
    assert "emacm.order_psd" in loaded
    assert not OPTIONAL & loaded


def test_the_names_of_the_contract_import_from_the_package():
    names = {
        "Recording",
        "OrderResampler",
        "OrderPSD",
        "BinTransformer",
        "CostSensitiveGaussianBayes",
        "expected_cost",
        "neg_expected_cost",
    }
    assert names <= set(emacm.__all__)


def test_the_package_has_all_it_promises():
    assert not [name for name in emacm.__all__ if not hasattr(emacm, name)]


@pytest.mark.parametrize("name", sorted(set(emacm.__all__) - {"__version__"}))
def test_public_names_come_from_the_modules_that_define_them(name):
    assert getattr(emacm, name).__module__ == f"emacm.{emacm._HOME[name]}"
    assert name in dir(emacm)


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="'emacm' has no attribute 'nothing'"):
        emacm.nothing  # noqa: B018
