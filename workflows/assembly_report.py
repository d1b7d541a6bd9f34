"""What the assembly's stages leave behind: files of the run folder, numbers, tables."""

from pathlib import Path

import numpy as np
from pydantic import BaseModel

from fem.abaqus import input_deck
from workflows import field_file, figures
from workflows.assembly_stages import AssemblyModes, materials
from workflows.assembly_table import assembly
from workflows.picture_stage import NoPicture
from workflows.reduced_wall import save
from workflows.reduction_health import reduction_health
from workflows.run_folder import Picture, RunFolder, checked_file, write_pictures
from workflows.scene import InvalidScene
from workflows.stages import Pipeline
from workflows.summary import HAMMER_TEST_HZ
from workflows.wall_file import require_reader

FORMATS = (".npz", ".mat", ".h5")


def write_assembly(pipeline: Pipeline, folder: RunFolder) -> tuple[str, ...]:
    """Modes, reduced model and pictures, each as soon as it is there; warnings come back."""
    modes = pipeline("modes")
    with folder.writing("modes.vtu") as path:
        field_file.write(path, modes.field)
    for name in ("rom.npz", "rom.mat"):
        with folder.writing(name) as path:
            save(path, pipeline("reduction"))
    write_pictures(folder, (pipeline("response").picture,))
    try:
        write_pictures(folder, pipeline("pictures"))
    except NoPicture as missing:
        return (str(missing),)
    return ()


def assembly_numbers(pipeline: Pipeline) -> dict:
    """The assembly's part of the summary."""
    modes, reduced = pipeline("modes"), pipeline("reduction")
    return {
        "modes_hz": paired_hz(modes),
        "dofs": modes.n_dofs,
        "reduction": reduction_health(reduced),
    }


def paired_hz(modes: AssemblyModes) -> dict[str, float]:
    """Frequencies of the hammer-test modes that were found, by their number."""
    hz = modes.omega / (2 * np.pi)
    return {str(i + 1): float(hz[j]) for i, j in enumerate(modes.index) if j >= 0}


READING = """\
at contact: participation [kg^-1/2];  score: share of the mode's energy in the block's motion of
that hammer-test mode;  MAC: likeness to that mode of stiff joints"""


class ModeRow(BaseModel):
    """One computed mode; `hammer_mode` where it is paired with one of the test.

    `score` is the share of its energy in that mode's motion of the block, `mac` its likeness to
    that mode of stiff joints.
    """

    number: int
    frequency_hz: float
    participation: float
    hammer_mode: int | None = None
    hammer_hz: float | None = None
    difference_percent: float | None = None
    score: float | None = None
    mac: float | None = None


class ModeTable(BaseModel):
    """All computed modes with their participation at the contact [kg^-1/2]."""

    scene: str
    rows: list[ModeRow]

    def text(self) -> str:
        """Aligned lines."""
        head = f"{'mode':>5} {'Hz':>10} {'at contact':>11}  {'hammer test':<20}"
        lines = [f"{head}{'score':>6}{'MAC':>6}", *(_line(row) for row in self.rows)]
        return "\n".join([*lines, "", READING])


def mode_table(pipeline: Pipeline) -> ModeTable:
    """Modes beside the hammer test."""
    modes = pipeline("modes")
    participation, likeness = pipeline("contact").w @ modes.phi, pipeline("likeness")
    tested = {int(j): i for i, j in enumerate(modes.index) if j >= 0}
    rows = [
        _row(j, hz, participation[j], tested.get(j), modes.score, likeness[j])
        for j, hz in enumerate(modes.omega / (2 * np.pi))
    ]
    return ModeTable(scene=pipeline.scene.name, rows=rows)


def mac_picture(pipeline: Pipeline) -> Picture:
    """The MAC matrix of the modes found with those of stiff joints."""
    hz = pipeline("modes").omega / (2 * np.pi)
    return Picture("mac", figures.mac_matrix(pipeline("likeness"), hz))


def _row(j: int, hz: float, participation: float, tested: int | None, score, mac) -> ModeRow:
    row = ModeRow(number=j + 1, frequency_hz=hz, participation=abs(participation))
    if tested is None:
        return row
    target = HAMMER_TEST_HZ[tested]
    return row.model_copy(
        update={
            "hammer_mode": tested + 1,
            "hammer_hz": target,
            "difference_percent": 100 * (hz / target - 1),
            "score": float(score[tested]),
            "mac": None if np.isnan(mac[tested]) else float(mac[tested]),
        }
    )


def _line(row: ModeRow) -> str:
    line = f"{row.number:5} {row.frequency_hz:10.2f} {row.participation:11.4f}"
    if row.hammer_mode is None:
        return line
    test = f"{row.hammer_mode}: {row.hammer_hz:g} Hz ({row.difference_percent:+.1f} %)"
    mac = "-" if row.mac is None else f"{row.mac:.2f}"
    return f"{line}  {test:<20}{row.score:6.2f}{mac:>6}"


def write_model(pipeline: Pipeline, inp: Path | None, step: Path | None) -> None:
    """The model as an input deck for CalculiX or Abaqus, the geometry as STEP."""
    scene = pipeline.scene
    if step and step.suffix.lower() not in (".step", ".stp"):
        raise InvalidScene(f"--step {step} must end in .step or .stp.")
    for option, path in (("--inp", inp), ("--step", step)):
        if path:
            checked_file(path, option)
    if inp:
        model = pipeline("model")
        steel = materials(scene.assembly, model.structure.basis.mesh.subdomains)
        with _beside(inp) as part:
            part.write_text(input_deck(model, steel), encoding="utf-8")
    if step:
        from geometry.tet_mesh import write_step

        with _beside(step) as part:
            write_step(assembly(scene.assembly), part)


def _beside(path: Path):
    return RunFolder(path.parent).writing(path.name)


def write_reduced(pipeline: Pipeline, path: Path) -> None:
    """Write the reduced model; raises InvalidScene for an unknown ending."""
    if path.suffix not in FORMATS:
        raise InvalidScene(f"--out {path} must end in one of {', '.join(FORMATS)}.")
    require_reader(path)
    checked_file(path)
    reduced = pipeline("reduction")
    with _beside(path) as part:
        save(part, reduced)
