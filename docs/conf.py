"""Sphinx configuration: Markdown pages by MyST, the API reference from docstrings."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

from sphinx.application import Sphinx

import veca_marl

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path += [str(DOCS / "_extensions"), str(ROOT)]  # ROOT: the package tools

project = "veca_marl"
author = "the authors of veca_marl"
copyright = "2026, the authors of veca_marl"
release = version = veca_marl.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.apidoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",  # [source]
    "api_links",
    "mathml",
]
html_math_renderer = "mathml"
exclude_patterns = ["_build", "history"]
default_role = "code"  # docstrings write `name` for code

html_theme = "furo"
html_static_path = ["_static"]  # the clips of the gallery
html_title = f"veca_marl {release}"

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_custom_sections = [("Terms", "params_style"), ("Observations", "params_style")]
# an object is documented where it is defined, not in the packages that export it
autodoc_default_options = {"ignore-module-all": True}
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
maximum_signature_line_length = 80  # longer ones have an argument in each line
autodoc_member_order = "bysource"
toc_object_entries = False  # thousands of entries in every sidebar otherwise

apidoc_modules = [
    {
        "path": "../veca_marl",
        "destination": "api",
        "module_first": True,
        "automodule_options": ["members", "show-inheritance"],
        "max_depth": 1,
    }
]
autodoc_use_type_comments = False  # there are none; looking for them parses every source
if tags.has("written_pages"):  # noqa: F821  Sphinx defines it: -t written_pages leaves out the API
    apidoc_modules = []
    exclude_patterns.append("api")  # of an earlier build


def copy_pages(_: Sphinx) -> None:
    """Copy what the site shows and what lies elsewhere: the experiments and the changelog."""
    shutil.rmtree(DOCS / "experiments", ignore_errors=True)
    shutil.copytree(
        ROOT / "experiments", DOCS / "experiments", ignore=shutil.ignore_patterns("*.py", "__*")
    )
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    # pages of history are in the repository only
    text = re.sub(r"\[(docs/history/\S+?)\]\(\1\)", r"`\1`", text).replace("](docs/", "](")
    (DOCS / "changelog.md").write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> None:
    """Register the copy to run before any page is read."""
    app.connect("builder-inited", copy_pages, priority=100)
