"""Joints tuned to measured modes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from re import sub
from typing import TYPE_CHECKING

from workflows.api.progress import Progress, quiet
from workflows.files.hammer import HAMMER
from workflows.files.output_file import OutputFile
from workflows.files.scene import Changes, Source, files_read
from workflows.files.scene import scene as load_scene
from workflows.scene import InvalidScene, Scene
from workflows.scene.named_files import require_file
from workflows.scene.parts import with_assembly, with_targets
from workflows.scene.scene import LONGEST_NAME

if TYPE_CHECKING:
    from workflows.assembly.tuning import TuningReport


USUAL = Path("NAME-tuned.toml")


@dataclass(frozen=True, repr=False)
class Tuned:
    """The scene with the joints found, its report, and the file it was written to, if any."""

    scene: Scene
    report: TuningReport
    file: Path | None

    def __repr__(self) -> str:
        return self.report.text()


def tune(
    scene: Source = None,
    changes: Changes = (),
    *,
    match: str | Iterable[int] | Mapping[int, float] | None = None,
    free: str | Iterable[str] = (),
    hammer: str | Path | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Tuned:
    """Joint stiffnesses, and materials, fitted to measured modes (`beadwave tune`).

    match   modes by number, [1, 3, 4], or with frequencies of one's own, {1: 51.2, 3: 905.0} [Hz];
            all targets of the scene without it
    free    what to vary, ["joints.NAME.kz", "materials.NAME.young"]; of the rig "head.ky"
    hammer  a hammer test (.csv, .uff) to take frequencies and damping from
    out     a file for the tuned scene (.toml), or USUAL for NAME-tuned.toml; a file that
            beadwave did not write, or that was changed since, is replaced with `overwrite` alone

    A mode missed by more than 5 % is a failure: `report.failures` lists them in sentences, and
    nothing is written. Raises InvalidScene for bad input.
    """
    if hammer:
        require_file(hammer, HAMMER)
    chosen = with_assembly(load_scene(scene, changes))
    measured_hz = with_targets(chosen).measured_hz
    from workflows.assembly.tuning import targets, tuned, write_scene

    wanted_text = _matched(match)
    every = ",".join(map(str, range(1, len(measured_hz) + 1)))
    wanted = targets(every if wanted_text is None else wanted_text, measured_hz)
    if hammer:
        from workflows.assembly.hammer import applied, hammer_test, recognised
        from workflows.files.shapes import has_shapes
        from workflows.pipeline.pipeline import pipeline_of

        test = hammer_test(Path(hammer), wanted)
        if chosen.is_general and has_shapes(Path(hammer)):
            test = recognised(test, pipeline_of(chosen, progress), wanted)
        chosen, wanted = applied(chosen, test.report, wanted_text)
    path = f"{chosen.name}-tuned.toml" if out is USUAL else out
    read = (*files_read(chosen, scene), *((Path(hammer),) if hammer else ()))
    written = {"inputs": read, "ending": ".toml", "overwrite": overwrite}
    file = OutputFile(path, **written) if path else None
    result, report = tuned(chosen, wanted, _names(free), progress)
    if file is None or report.failures:
        return Tuned(result, report, None)
    result = result.model_copy(update={"name": _scene_name(file.path)})
    write_scene(result, file, report)
    return Tuned(result, report, file.path)


def _matched(match: str | Iterable[int] | Mapping[int, float] | None) -> str | None:
    if match is None or isinstance(match, str):
        return match
    if isinstance(match, Mapping):
        return ",".join(f"{n}={hz!r}" for n, hz in match.items())
    return ",".join(map(str, match))


def _names(free: str | Iterable[str]) -> tuple[str, ...]:
    names = tuple(free.split(",")) if isinstance(free, str) else free
    if not isinstance(names, Iterable) or not all(isinstance(name, str) for name in names):
        raise InvalidScene(
            f'free = {free!r} must be names, as in ["joints.NAME.kz", "materials.NAME.young"].'
        )
    return tuple(name.strip() for name in names)


def _scene_name(path: Path) -> str:
    return sub(r"[^\w.-]", "-", path.stem).lstrip(".-")[:LONGEST_NAME] or "tuned"
