"""Sphinx: MyST pages, the interface from docstrings, warnings are errors (docs/build.sh)."""

import sys
from importlib.metadata import version as installed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from plain_docstrings import as_rst

project = "beadwave"
author = "The beadwave authors"
copyright = f"{author}, GPL-3.0-or-later"
release = installed("beadwave")

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.mathjax"]
exclude_patterns = ["_build", "_site", "jupyter_execute"]
nb_execution_mode = "off"  # the tests run the notebooks
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "imported-members": True}
html_theme = "furo"
html_title = "beadwave"
html_copy_source = False


def setup(app):
    """Docstrings as they are written."""

    def plain(app, what, name, object, options, lines):
        lines[:] = as_rst(lines)

    app.connect("autodoc-process-docstring", plain)
