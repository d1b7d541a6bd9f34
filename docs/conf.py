"""Sphinx: MyST pages, the interface from docstrings, warnings are errors (docs/build.sh)."""

import re
import sys
from importlib.metadata import version as installed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from docutils.nodes import SkipNode
from fields import fields
from latex2mathml.converter import convert
from plain_docstrings import as_rst, escaped

project = "beadwave"
author = "The beadwave authors"
copyright = f"{author}, GPL-3.0-or-later"
release = installed("beadwave")

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.autosummary"]
exclude_patterns = ["_build", "_site", "jupyter_execute", "templates"]
templates_path = ["templates"]
autosummary_generate = True  # a page for each function and class, in docs/reference
autosummary_imported_members = True
autosummary_ignore_module_all = False
nb_execution_mode = "off"  # the tests run the notebooks, which hold what they show
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "imported-members": True}
html_math_renderer = "mathml"  # by the browser itself: pages are read without a network
html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_title = "beadwave"
html_copy_source = False


def setup(app):
    """Formulas, docstrings as they are written, the fields of a class with their comments, and
    names that break between their words."""

    def formula(translator, node):
        """MathML in place of what a script would draw."""
        display = "block" if node.tagname == "math_block" else "inline"
        translator.body.append(convert(node.astext(), display=display))
        raise SkipNode

    def plain(app, what, name, object, options, lines):
        """Docstrings are prose, no reStructuredText; fields are described by their comments."""
        lines[:] = as_rst(lines)
        if what == "class" and (rows := fields(object)):
            lines += [".. rubric:: Fields", ""]
            for field in rows:
                words = "; ".join(filter(None, [f"``{field.type}``", escaped(field.words)]))
                lines += [f"``{field.name}``", f"    {words}", ""]

    def breakable(app, pagename, templatename, context, doctree):
        """Names in code and headings may break after the signs between their words; numbers and
        units, as 0.5 and kg/m, do not."""
        if "body" in context:
            context["body"] = re.sub(
                r'(?:(?<=<span class="pre">)|(?<=<h1>))[^<]+',
                lambda name: re.sub(r"(?<=\w{3})([_./]+)(?=[^\W\d])", r"\1<wbr>", name[0]),
                context["body"],
            )

    def listed_above(app, what, name, object, skip, options):
        """Leave out what Python makes of the fields of a NamedTuple."""
        return True if (object.__doc__ or "").startswith("Alias for field number") else None

    app.add_html_math_renderer("mathml", (formula, None), (formula, None))
    app.connect("autodoc-process-docstring", plain)
    app.connect("autodoc-skip-member", listed_above)
    app.connect("html-page-context", breakable)
