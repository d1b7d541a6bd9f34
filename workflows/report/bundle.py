"""The page's own JavaScript, modules of `page/`, as one script for a page without a server.

Each module becomes a function of its own that is called once, in the order of the imports: an
import takes from what the other has returned.
"""

import re
from importlib.resources import files

PAGE = files("beadwave.workflows.report") / "page"
IMPORT = re.compile(r'^import (\{[^}]*\}) from "\./(\w+)\.js";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:function|const) (\w+))", re.MULTILINE)


def text(name: str) -> str:
    """A file of the page."""
    return (PAGE / name).read_text(encoding="utf-8")


def bundled(first: str) -> str:
    """The module of this name, and all that it imports, as one script."""
    functions = []
    for name in _in_order(first, {}):
        source = text(f"{name}.js")
        exported = ", ".join(EXPORT.findall(source))
        source = IMPORT.sub(r"const \1 = module_\2;\n", EXPORT.sub("", source))
        functions.append(
            f"const module_{name} = (() => {{\n{source}\nreturn {{ {exported} }};\n}})();"
        )
    return '"use strict";\n' + "\n".join(functions)


def _in_order(name: str, modules: dict[str, None]) -> list[str]:
    """The modules that one imports, each before those that need it, and itself."""
    for _, imported in IMPORT.findall(text(f"{name}.js")):
        if imported not in modules:
            _in_order(imported, modules)
    modules[name] = None
    return list(modules)
