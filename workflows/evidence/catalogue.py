"""The studies, found in their folders by what their functions return.

A module of `accuracy` has one public function of the scene that returns a `Finding`, a module of
`stability` one public generator of trials for each case, one of `verify` a generator of comparisons
for each group. The function's name with hyphens is that of the study, the first line of
its docstring its line in the listing. Another study is another file; nothing is listed by hand, and
listing imports none of them.
"""

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from beadwave.workflows.evidence.harness import finding, rows_of
from beadwave.workflows.evidence.study import counted
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.scene import InvalidScene, Scene, nearest
from beadwave.workflows.stages.progress import Progress

# what the functions of a folder return, and the option by which their names are given
FOLDERS = {
    "accuracy": ("Finding", "--stage"),
    "stability": ("Iterator[Trial]", "--case"),
    "verify": ("Iterator[Comparison]", "--group"),
}


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


def accuracy(
    stage: str, scene: Callable[[str], Scene], progress: Progress, *, thorough: bool = False
) -> dict[str, Finding]:
    """The accuracy studies of a stage by name; `scene` gives the scene for a study's usual one.

    A module of a study may have THOROUGH, its keyword arguments where all is wanted, and LEFT_OUT,
    what it does not show without them, which becomes a sentence. One with ALONE = True is left out
    where all stages run, unless `thorough`.
    """
    entries = chosen("accuracy", () if stage == "all" else (stage,))
    if stage == "all" and not thorough:
        entries = {name: entry for name, entry in entries.items() if not entry.stated("ALONE")}
    findings = {}
    for name, entry in counted(entries.items(), progress, lambda pair: pair[0]):
        options = entry.stated("THOROUGH", {}) if thorough else {}
        findings[name] = entry(scene(entry.stated("SCENE")), progress, **options)
        if not thorough and (left_out := entry.stated("LEFT_OUT")):
            sentence = f"Left out of {name}: {left_out}; --thorough brings it."
            sentences = (*findings[name].sentences, sentence)
            findings[name] = findings[name]._replace(sentences=sentences)
    return findings


def accuracy_alone() -> tuple[str, ...]:
    """Names of the accuracy studies that run only where they are named, or with `thorough`."""
    return tuple(name for name, entry in catalogue("accuracy").items() if entry.stated("ALONE"))


def verdicts(folder: str, names: tuple[str, ...], progress: Progress) -> Finding:
    """Verdicts on the cases of `stability`, or the groups of `verify`, of these names, of all
    without any."""
    rows = []
    for name, entry in counted(chosen(folder, names).items(), progress, lambda pair: pair[0]):
        rows += rows_of(name, entry)
    return finding(folder, tuple(rows))
