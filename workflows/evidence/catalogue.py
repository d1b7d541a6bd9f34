"""The studies, found in their folders by what their functions return.

A module of `thesis` or `accuracy` has one public function of the scene that returns a `Finding`,
a module of `stability` one public generator of trials for each case, one of `verify` a generator of
comparisons for each group. The function's name with hyphens is that of the study, the first line of
its docstring its line in the listing. Another study is another file; nothing is listed by hand, and
listing imports none of them.
"""

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from workflows.report.finding import Finding
from workflows.scene import InvalidScene, Scene, nearest
from workflows.stages.progress import Progress

RETURNED = {
    "thesis": "Finding",
    "accuracy": "Finding",
    "stability": "Iterator[Trial]",
    "verify": "Iterator[Comparison]",
}
OPTION = {"stability": "--case", "verify": "--group"}  # by which names are given
ROWS = {"stability": "trials", "verify": "comparisons"}  # module of a row and of their table
TAKEN = {"thesis": ["scene", "progress"], "accuracy": ["scene", "progress"]}  # first arguments


class CatalogueEntry(NamedTuple):
    """A study: its module and function, and the line of its docstring in the listing."""

    module: str
    function: str
    shows: str

    def loaded(self) -> ModuleType:
        """The module, imported."""
        return import_module(self.module)

    def __call__(self, *arguments, **options):
        return getattr(self.loaded(), self.function)(*arguments, **options)


def catalogue(folder: str) -> dict[str, CatalogueEntry]:
    """The studies of a folder by name, read from the source of its modules without an import."""
    entries = {}
    for file in sorted(Path(__file__).with_name(folder).glob("*.py")):
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
                continue
            first = [argument.arg for argument in node.args.args[:2]]
            if first != TAKEN.get(folder, first):
                continue  # puts a finding together for the study beside it
            if node.returns and ast.unparse(node.returns) == RETURNED[folder]:
                module = f"{__package__}.{folder}.{file.stem}"
                shows = (ast.get_docstring(node) or "").partition("\n")[0]
                name = node.name.replace("_", "-")
                entries[name] = CatalogueEntry(module, node.name, shows)
    return entries


def listing(folder: str) -> str:
    """The studies of a folder, a line each: the name in 20 columns, then what it shows."""
    return "\n".join(f"{name:20}{entry.shows}" for name, entry in catalogue(folder).items())


def chosen(folder: str, names: tuple[str, ...], option: str) -> dict[str, CatalogueEntry]:
    """The studies of these names, all if there are none; raises InvalidScene for an unknown name,
    which it says was given to `option`."""
    entries = catalogue(folder)
    for name in names:
        if name not in entries:
            raise InvalidScene(f"{option} {name!r} is not known; {nearest(name, entries)}.")
    return {name: entries[name] for name in names} or entries


def study(name: str, scene: Scene, progress: Progress) -> Finding:
    """What a study of the thesis finds on the scene."""
    return chosen("thesis", (name,), "study")[name](scene, progress)


def usual_scene(name: str) -> str | None:
    """The built-in scene that a study is made for, its SCENE; None for the rig."""
    return getattr(chosen("thesis", (name,), "study")[name].loaded(), "SCENE", None)


def accuracy(
    stage: str, scene: Callable[[str], Scene], progress: Progress, *, thorough: bool = False
) -> dict[str, Finding]:
    """The accuracy studies of a stage by name; `scene` gives the scene for a study's usual one.

    A module of a study may have THOROUGH, its keyword arguments where all is wanted, and LEFT_OUT,
    what it does not show without them, which becomes a sentence. One with ALONE = True is left out
    where all stages run, unless `thorough`.
    """
    findings = {}
    for name, entry in chosen("accuracy", () if stage == "all" else (stage,), "--stage").items():
        module = entry.loaded()
        if stage == "all" and getattr(module, "ALONE", False) and not thorough:
            continue
        with progress(name):
            options = getattr(module, "THOROUGH", {}) if thorough else {}
            finding = entry(scene(module.SCENE), progress, **options)
        if not thorough and hasattr(module, "LEFT_OUT"):
            sentence = f"Left out of {name}: {module.LEFT_OUT}; --thorough brings it."
            finding = finding._replace(sentences=(*finding.sentences, sentence))
        findings[name] = finding
    return findings


def accuracy_alone() -> tuple[str, ...]:
    """Names of the accuracy studies that run only where they are named, or with `thorough`."""
    entries = catalogue("accuracy").items()
    return tuple(name for name, entry in entries if getattr(entry.loaded(), "ALONE", False))


def verdicts(folder: str, names: tuple[str, ...], progress: Progress) -> Finding:
    """Verdicts on the cases of `stability`, or the groups of `verify`, of these names, of all
    without any."""
    of_rows = import_module(f"{__package__}.{folder}.{ROWS[folder]}")
    rows = []
    for name, entry in chosen(folder, names, OPTION[folder]).items():
        with progress(name):
            rows += of_rows.rows_of(name, entry)
    return of_rows.finding(tuple(rows))
