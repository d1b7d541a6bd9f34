"""Error against run time, extreme cases, independent codes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.files.scene import DEFAULT, Changes, Source, files_read
from beadwave.workflows.files.scene import scene as load_scene
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.progress import Progress, quiet

if TYPE_CHECKING:
    from beadwave.workflows.report.finding import Finding


def studies(folder: str) -> dict[str, str]:
    """Names of studies and what each shows; folder is "accuracy", "stability" or "verify"."""
    from beadwave.workflows.evidence.catalogue import catalogue

    return {name: entry.shows for name, entry in catalogue(folder).items()}


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
    """Error against run time, beside general-purpose integrators (`beadwave accuracy`).

    scene     a scene; default: the one each study is made for
    stage     only this study, of `studies("accuracy")`; default: all
    thorough  leave nothing out, of one stage or of all: minutes
    out       folder for tables (CSV, JSON) and pictures, where each stage adds or renews its own

    What takes minutes is left out without `thorough`; sentences say what. Raises InvalidScene for
    bad input.
    """
    from beadwave.workflows.evidence import catalogue
    from beadwave.workflows.evidence.accuracy import folder as files
    from beadwave.workflows.report import finding

    def scene_of(usual: str) -> Scene:
        return load_scene(usual if scene is None else scene, changes)

    inputs = files_read(scene_of(DEFAULT), scene) if scene is not None else ()
    folder = _folder(out, inputs, overwrite, files.FILES)
    findings = catalogue.accuracy(stage, scene_of, progress, thorough=thorough)
    if folder:
        files.write(findings, folder)
    result = finding.merged(findings.values())
    if stage == "all" and not thorough and (alone := catalogue.accuracy_alone()):
        stages = f"Left out: the stages {', '.join(alone)}; "
        remedy = "--stage with the name runs one, --thorough all."
        result = result._replace(sentences=(*result.sentences, stages + remedy))
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
    from beadwave.workflows.evidence import catalogue

    return _written(
        lambda: catalogue.verdicts("stability", tuple(cases), progress), "stability", out, overwrite
    )


def verify(
    groups: Iterable[str] = (),
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Finding:
    """Our results beside independent codes, published and exact ones (`beadwave verify`).

    groups  only these, of `studies("verify")`
    out     folder for the table as CSV

    The table's column `verdict` is within, outside, failed or skipped.
    """
    from beadwave.workflows.evidence import catalogue

    return _written(
        lambda: catalogue.verdicts("verify", tuple(groups), progress), "verify", out, overwrite
    )


def _written(
    compute: Callable[[], Finding], name: str, out: str | Path | None, overwrite: bool
) -> Finding:
    """What `compute` returns, written into the folder `out` if there is one; a folder that may not
    be written to is refused before anything is computed."""
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
    folder = RunFolder(Path(out), inputs=inputs, overwrite=overwrite)
    folder.require(*files)
    return folder
