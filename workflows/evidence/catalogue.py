"""The studies of the thesis, found in their folder by what their functions return.

A module of `thesis` has one public function of the scene that returns a `Finding`. The function's
name with hyphens is that of the study, the first line of its docstring its line in the listing.
Another study is another file; nothing is listed by hand, and listing imports none of them.
"""

import ast
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from beadwave.workflows.report.finding import Finding
from beadwave.workflows.scene import InvalidScene, Scene, nearest
from beadwave.workflows.stages.progress import Progress

# what the functions of a folder return, and the option by which their names are given
FOLDERS = {"thesis": ("Finding", "study")}


class CatalogueEntry(NamedTuple):
    """A study: its module and function, and the line of its docstring in the listing."""

    module: str
    function: str
    shows: str

    def __call__(self, *arguments, **options):
        return getattr(import_module(self.module), self.function)(*arguments, **options)

    def stated(self, name: str, default: Any = None) -> Any:
        """What the module says of its study in capitals, as its usual SCENE."""
        return getattr(import_module(self.module), name, default)


def catalogue(folder: str) -> dict[str, CatalogueEntry]:
    """The studies of a folder by name, read from the source of its modules without an import."""
    returned, entries = FOLDERS[folder][0], {}
    for file in sorted(Path(__file__).with_name(folder).glob("*.py")):
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
                continue
            first = [argument.arg for argument in node.args.args[:2]]
            if returned == "Finding" and first != ["scene", "progress"]:
                continue  # puts a finding together for the study beside it
            if node.returns and ast.unparse(node.returns) == returned:
                module = f"{__package__}.{folder}.{file.stem}"
                shows = (ast.get_docstring(node) or "").partition("\n")[0]
                name = node.name.replace("_", "-")
                entries[name] = CatalogueEntry(module, node.name, shows)
    return entries


def listing(folder: str) -> str:
    """The studies of a folder, a line each: the name in 20 columns, then what it shows."""
    return "\n".join(f"{name:20}{entry.shows}" for name, entry in catalogue(folder).items())


def chosen(folder: str, names: tuple[str, ...]) -> dict[str, CatalogueEntry]:
    """The studies of these names, all if there are none; raises InvalidScene for an unknown one."""
    entries = catalogue(folder)
    for name in names:
        if name not in entries:
            option = FOLDERS[folder][1]
            raise InvalidScene(f"{option} {name!r} is not known; {nearest(name, entries)}.")
    return {name: entries[name] for name in names} or entries


def study(name: str, scene: Scene, progress: Progress) -> Finding:
    """What a study of the thesis finds on the scene."""
    return chosen("thesis", (name,))[name](scene, progress)


def usual_scene(name: str) -> str | None:
    """The built-in scene that a study is made for, its SCENE; None for the rig."""
    return chosen("thesis", (name,))[name].stated("SCENE")
