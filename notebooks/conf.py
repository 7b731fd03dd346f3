"""Configuration of the site: ``sphinx-build -W notebooks site`` builds it without a network."""

import importlib
import os

from docutils import nodes
from sphinx import addnodes

import emacm

os.environ["MPLBACKEND"] = "Agg"  # before an example imports matplotlib

PUBLIC_MODULES = ["emacm", "emacm.monitoring", "emacm.displays", "emacm.simulation"]
PUBLIC_MODULES += ["emacm.datasets"]
PAGES_WITHOUT_CHILDREN = ["index", "installation", "terms", "limits", "evidence", "comparison"]
PAGES_WITHOUT_CHILDREN += ["compositions", "contributing", "architecture", "cite", "changes"]

# Pages of packages; their addresses follow from the name: no inventory is needed.
PAGES = {
    "numpy.random": "https://numpy.org/doc/stable/reference/random/generated/",
    "numpy": "https://numpy.org/doc/stable/reference/generated/",
    "pandas": "https://pandas.pydata.org/docs/reference/api/",
    "scipy": "https://docs.scipy.org/doc/scipy/reference/generated/",
    "sklearn": "https://scikit-learn.org/stable/modules/generated/",
}

project = "emacm"
author = copyright = "The emacm developers"
release = version = emacm.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_nb",
    "sphinx_design",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
]
default_role = "py:obj"
exclude_patterns = ["templates", "gallery", "examples/*.ipynb", "examples/*.py"]
templates_path = ["templates"]

# Notebooks are stored executed; myst-nb must not run them again.
nb_execution_mode = "off"
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_typehints = "none"
autodoc_member_order = "groupwise"
numpydoc_show_class_members = False  # the template of classes lists them

sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "examples",
    "filename_pattern": r"\.py$",
    "within_subsection_order": "FileNameSortKey",
    "backreferences_dir": "reference/used_in",
    "doc_module": ("emacm",),
    "notebook_extensions": {},
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 1_000,
    "thumbnail_size": (400, 280),
    "plot_gallery": "True",
    "capture_repr": ("_repr_html_",),
}

html_theme = "pydata_sphinx_theme"
html_title = f"emacm {release}"
html_static_path = ["static"]
html_css_files = ["emacm.css"]
html_copy_source = html_show_sourcelink = False
html_sidebars = {page: [] for page in PAGES_WITHOUT_CHILDREN}
html_theme_options = {
    "logo": {"text": "emacm"},
    "navbar_align": "left",
    "header_links_before_dropdown": 6,
    "show_prev_next": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
}


def public_names():
    """Return each public name with the name under which it is documented."""
    full = {}
    for module in map(importlib.import_module, PUBLIC_MODULES):
        for name in getattr(module, "__all__", ["load_cranfield"]):
            full.setdefault(name, f"{module.__name__}.{name}")
    return full


FULL_NAMES = public_names()


def link_bare_name(app, env, node, content):
    """Link `OrderPSD` and `OrderPSD.fit` from any page, and names of NumPy, SciPy and so on."""
    target = node.get("reftarget", "").removesuffix("()")
    for package, address in PAGES.items():
        if target.startswith(f"{package}."):
            return nodes.reference("", "", content, refuri=f"{address}{target}.html")
    name, *rest = target.split(".")
    full = ".".join([FULL_NAMES.get(name, name), *rest])
    if node.get("refdomain") != "py" or full == target:
        return None
    domain = env.get_domain("py")
    return domain.resolve_xref(env, node["refdoc"], app.builder, "obj", full, node, content)


def skip_inherited(app, kind, name, member, skip, options):
    """Leave out the methods that scikit-learn and Python add to a class."""
    module = getattr(member, "__module__", None) or "emacm"
    return skip or not module.startswith("emacm") or None


def drop_citations(app, doctree):
    """Remove the citations in the tables of the reference: their sources are not on that page."""
    if app.env.docname == "reference":
        for citation in list(doctree.findall(addnodes.pending_xref)):
            if citation.get("refdomain") == "citation":
                before = citation.parent[citation.parent.index(citation) - 1]
                before.parent.replace(before, nodes.Text(before.astext().rstrip()))
                citation.parent.remove(citation)


def setup(app):
    """Connect the functions above."""
    app.connect("missing-reference", link_bare_name)
    app.connect("doctree-read", drop_citations)
    app.connect("autodoc-skip-member", skip_inherited)
