"""Modes of an assembly, and its model for other programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from workflows.api.folders import picture_folder
from workflows.api.progress import Progress, quiet
from workflows.files.output_file import output_files
from workflows.files.run_folder import Picture, write_pictures
from workflows.files.scene import Changes, Source, files_read
from workflows.files.scene import scene as load_scene
from workflows.scene import InvalidScene, Scene
from workflows.scene.parts import with_assembly, with_structure

if TYPE_CHECKING:
    import xarray

    from workflows.assembly.mode_table import ModeTable
    from workflows.assembly.thesis_tables import Table
    from workflows.pipeline.pipeline import Pipeline


@dataclass(frozen=True, repr=False)
class Modes:
    """Modes of an assembly: `table.rows` one by one, `data` as arrays, `plot()` their MAC."""

    scene: Scene
    table: ModeTable
    pipeline: Pipeline

    @property
    def data(self) -> xarray.Dataset:
        """frequency [Hz] and participation at the contact [kg^-1/2] over mode; mac over mode and
        target, with the modes of stiff joints."""
        from workflows.results.arrays import dataset

        rows, mac = self.table.rows, self.pipeline("mac")
        per_mode = {
            "frequency": (("mode",), np.array([r.frequency_hz for r in rows]), "Hz"),
            "participation": (
                ("mode",),
                np.array([r.participation for r in rows], float),
                "kg^-1/2",
            ),
        }
        numbers = {"mode": [row.number for row in rows], "target": np.arange(1, mac.shape[1] + 1)}
        return dataset(per_mode | {"mac": (("mode", "target"), mac, "1")}, **numbers)

    def plot(self) -> Picture:
        """The MAC matrix with the modes of stiff joints; raises InvalidScene without targets."""
        from workflows.assembly.mode_table import mac_picture

        return mac_picture(self.pipeline)

    def __repr__(self) -> str:
        return self.table.text()


def modes(
    scene: Source = None,
    changes: Changes = (),
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Modes:
    """Frequencies beside measured ones, MAC, participation at the contact (`beadwave modes`).

    `out` is a folder for the picture of the MAC matrix. Raises InvalidScene for bad input or a
    scene without an assembly, ValueError where a computation fails.
    """
    chosen = with_structure(load_scene(scene, changes))
    folder = picture_folder(out, files_read(chosen, scene), overwrite, "mac")
    from workflows.assembly.mode_table import mode_table
    from workflows.pipeline.pipeline import pipeline_of

    pipeline = pipeline_of(chosen, progress)
    found = Modes(chosen, mode_table(pipeline), pipeline)
    if folder:
        write_pictures(folder, (found.plot(),))
    return found


TABLES = ("5.2", "5.3")  # of the thesis, that can be computed again


def thesis_table(
    table: str,
    scene: Source = None,
    changes: Changes = (),
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Table:
    """Table 5.2 (models of ties) or 5.3 (tuned joints) of the thesis computed again, beside its
    numbers (`beadwave modes --table`); `out` gets the picture of 5.2, what each part changes."""
    if table not in TABLES:
        raise InvalidScene(f"--table {table} is not known; known are {' and '.join(TABLES)}.")
    chosen = with_assembly(load_scene(scene, changes))
    pictured = out if table == "5.2" else None
    inputs = files_read(chosen, scene)
    folder = picture_folder(pictured, inputs, overwrite, "component_effects")
    from workflows.assembly.thesis_tables import effects, table_52, table_53

    found = {"5.2": table_52, "5.3": table_53}[table](chosen, progress)
    if folder:
        write_pictures(folder, (effects(found),))
    return found


def export(
    scene: Source = None,
    changes: Changes = (),
    *,
    inp: str | Path | None = None,
    step: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> list[Path]:
    """The model as an input deck for CalculiX or Abaqus, the geometry as STEP; the files written
    (`beadwave modes --inp --step`). Files that beadwave did not write, or that were changed since,
    are only replaced with `overwrite`."""
    chosen = with_assembly(load_scene(scene, changes))
    given = {"--inp": inp, "--step": step}
    files = output_files(given, inputs=files_read(chosen, scene), overwrite=overwrite)
    from workflows.assembly.export import write_model
    from workflows.pipeline.pipeline import pipeline_of

    write_model(pipeline_of(chosen, progress), files.get("--inp"), files.get("--step"))
    return [file.path for file in files.values()]
