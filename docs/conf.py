"""How Sphinx builds the documentation: `python -m sphinx -W --keep-going -n docs docs/_build`."""

import sys
from pathlib import Path

from ffdcli import __version__

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "ffdcli"
author = "the ffdcli authors"
version = release = __version__
copyright = author

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "generated_pages",
    "mathml",
]
exclude_patterns = ["_build", "ci-recipe"]
nitpicky = True

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

# Types in the docstrings are words, as in "float, optional, model length": no links.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_param = False
napoleon_use_rtype = False
napoleon_use_ivar = False

html_theme = "furo"
html_title = f"ffdcli {version}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_math_renderer = "mathml"
