"""Hammer tests: measured ones read, computed ones written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from workflows.api.folders import picture_folder
from workflows.api.progress import Progress, quiet
from workflows.files.hammer import HAMMER
from workflows.files.run_folder import Picture, write_pictures
from workflows.files.scene import Changes, Source, files_read
from workflows.files.scene import scene as load_scene
from workflows.scene.named_files import require_file
from workflows.scene.parts import with_assembly

if TYPE_CHECKING:
    from workflows.assembly.hammer import HammerReport


@dataclass(frozen=True, repr=False)
class HammerTest:
    """A hammer test: `report.rows` a resonance each, and its responses drawn by `plot`."""

    report: HammerReport
    picture: Picture

    def plot(self) -> Picture:
        """Responses over frequency with the resonances found."""
        return self.picture

    def __repr__(self) -> str:
        return self.report.text()


def hammer(
    file: str | Path,
    scene: Source = None,
    changes: Changes = (),
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> HammerTest:
    """Frequencies and damping of a measured response by two methods (`beadwave hammer`).

    `file` is .uff (data set 58) or .csv: a header line, then frequency_hz, re_1, im_1, re_2, im_2,
    ... on each line. The resonances are paired with the measured modes of `scene`, by frequency, or
    where a .uff has the points of its responses (data set 15 or 2411) by the MAC of their shapes
    with the modes of an assembly of bodies. `out` is a folder for the picture. Needs the extra
    `identify`. Raises InvalidScene for bad input.
    """
    path = require_file(file, HAMMER)
    chosen = with_assembly(load_scene(scene, changes))
    inputs = (*files_read(chosen, scene), path)
    folder = picture_folder(out, inputs, overwrite, "hammer")
    from workflows.assembly.hammer import hammer_test, picture, recognised
    from workflows.files.shapes import has_shapes
    from workflows.pipeline.pipeline import pipeline_of

    with progress("identification"):
        wanted = dict(enumerate(chosen.measured_hz, start=1))
        found = hammer_test(path, wanted)
    if chosen.is_general and has_shapes(path):
        found = recognised(found, pipeline_of(chosen, progress), wanted)
    with progress("picture"):
        drawn = HammerTest(found.report, picture(found))
    if folder:
        write_pictures(folder, (drawn.plot(),))
    return drawn


def write_hammer_test(
    file: str | Path,
    scene: Source = None,
    changes: Changes = (),
    *,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Path:
    """A computed hammer test with noise, marked SYNTHETIC, to a .uff or .csv file
    (`beadwave hammer --synthetic`); one that beadwave did not write, or that was changed since, is
    only replaced with `overwrite`."""
    chosen = with_assembly(load_scene(scene, changes))
    from workflows.files.hammer import synthetic_file, write_synthetic

    written = synthetic_file(Path(file), overwrite)
    from workflows.assembly.hammer import virtual_test
    from workflows.pipeline.pipeline import pipeline_of

    write_synthetic(written, virtual_test(pipeline_of(chosen, progress)))
    return written.path
