"""Error against run time, extreme cases, published and exact numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from beadwave.workflows.files.run_folder import RunFolder, checked_folder
from beadwave.workflows.files.scene import Changes, Source, files_read
from beadwave.workflows.files.scene import scene as load_scene
from beadwave.workflows.stages.engine.progress import Progress, quiet

if TYPE_CHECKING:
    from beadwave.workflows.report.finding import Finding


def studies(folder: str) -> dict[str, str]:
    """Names of studies and what each shows; folder is "accuracy", "stability" or "verify"."""
    from beadwave.workflows.evidence.groups import shown

    return shown(folder)


def accuracy(
    scene: Source = None,
    changes: Changes = (),
    *,
    stage: str = "all",
    thorough: bool = False,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Finding:
    """Error against run time, with general-purpose integrators (`beadwave accuracy`).

    scene     a scene; default: the one each study is made for
    stage     only this study, of `studies("accuracy")`; default: all
    thorough  leave nothing out, of one stage or of all: minutes
    out       folder for tables (CSV, JSON) and pictures, where each stage adds or renews its own

    What takes minutes is left out without `thorough`: the study `reduction`, unless it is named,
    finer meshes and the rig's screw tie. Raises InvalidScene for bad input.
    """
    from beadwave.workflows.evidence import groups
    from beadwave.workflows.evidence.accuracy import folder as files
    from beadwave.workflows.report import finding

    inputs = files_read(load_scene(scene, changes), scene) if scene is not None else ()
    folder = _folder(out, inputs, overwrite, files.FILES)
    findings = {}
    for name, study in groups.chosen("accuracy", () if stage == "all" else (stage,)).items():
        if name == "reduction" and stage == "all" and not thorough:
            continue
        options = {"thorough": thorough} if name == "mesh" else {}
        case = load_scene(groups.SCENES[name] if scene is None else scene, changes)
        with progress(name):
            findings[name] = study(case, progress, **options)
    if folder:
        files.write(findings, folder)
    result = finding.merged(findings.values())
    if stage == "all" and not thorough:
        sentence = "Left out: the stage reduction; --stage reduction runs it, --thorough all."
        result = result._replace(sentences=(*result.sentences, sentence))
    return result


def stability(
    cases: Iterable[str] = (),
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Finding:
    """Stiff and extreme cases with a verdict each (`beadwave stability`).

    cases   only these, of `studies("stability")`
    out     folder for the table as CSV
    """
    return _written(
        lambda: _verdicts("stability", tuple(cases), progress), "stability", out, overwrite
    )


def verify(
    groups: Iterable[str] = (),
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Finding:
    """Our results beside published and exact ones (`beadwave verify`).

    groups  only these, of `studies("verify")`
    out     folder for the table as CSV

    The table's column `verdict` is within, outside or failed.
    """
    return _written(lambda: _verdicts("verify", tuple(groups), progress), "verify", out, overwrite)


def _verdicts(folder: str, names: tuple[str, ...], progress: Progress) -> Finding:
    """Verdicts on the cases of `stability`, or the groups of `verify`, of these names, of all
    without any."""
    from beadwave.workflows.evidence import groups
    from beadwave.workflows.evidence.harness import finding, rows_of

    rows = []
    for name, pieces in groups.chosen(folder, names).items():
        with progress(name):
            rows += rows_of(name, pieces)
    return finding(folder, tuple(rows))


def _written(
    compute: Callable[[], Finding], name: str, out: str | Path | None, overwrite: bool
) -> Finding:
    """Result of `compute`, written into the folder `out` if there is one; a folder that may not be
    written to is refused before anything is computed."""
    from beadwave.workflows.report import finding

    folder = _folder(out, (), overwrite, finding.files(name))
    result = compute()
    if folder:
        finding.write(result, folder)
    return result


def _folder(
    out: str | Path | None, inputs: tuple[Path, ...], overwrite: bool, files: tuple[str, ...]
) -> RunFolder | None:
    if out is None:
        return None
    folder = RunFolder(checked_folder(Path(out)), inputs=inputs, overwrite=overwrite)
    folder.require(*files)
    return folder
