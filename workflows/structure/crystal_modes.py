"""The modes of a crystal at rest, and the waves of its lattice beside them."""

import numpy as np
from pydantic import BaseModel

from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report.summary_rows import bands
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.crystal.linear import branches, crystal_band_edges
from beadwave.workflows.stages.engine.pipeline import Pipeline

SHOWN = 20  # rows of the table as text
STILL = 1e-3  # of the highest frequency: below it a mode is a motion that nothing presses back
NOTE = (
    "Contacts are springs of their stiffness at rest. A finite crystal's modes lie in the bands of "
    "its endless lattice, or beside them where they live at its edges."
)


class CrystalMode(BaseModel):
    """A mode of the crystal on what it leans on."""

    number: int
    frequency_hz: float


class Branch(BaseModel):
    """Frequencies of the endless lattice's waves along an axis, a list for each wave number."""

    axis: str
    wave_number: list[float]  # [1/m]
    frequency_hz: list[list[float]]


class CrystalModeTable(BaseModel):
    """Modes of the finite crystal, bands and dispersion of its lattice."""

    scene: str
    rows: list[CrystalMode]
    n_still: int  # motions at 0 Hz, left out of the rows: rigid ones, loose spheres
    band_edges_hz: tuple[float, ...] | None
    dispersion: list[Branch]

    def text(self) -> str:
        """The table as text, its middle left out where it is long."""
        cells = [(row.number, f"{row.frequency_hz:.1f}") for row in self.rows]
        if len(cells) > SHOWN:
            cells = [*cells[: SHOWN - 3], ("...", ""), *cells[-2:]]
        lines = [aligned_text(("mode", "Hz"), cells), ""]
        if self.n_still:
            lines.append(f"{self.n_still} motions at 0 Hz are left out.")
        if self.band_edges_hz:
            lines.append(f"Bands of the endless lattice: {bands(self.band_edges_hz)}.")
        return "\n".join([*lines, NOTE])


def crystal_mode_table(pipeline: Pipeline) -> CrystalModeTable:
    """Modes of the crystal at rest; raises InvalidScene where no contact is pressed, and so none
    has a stiffness."""
    scene = pipeline.scene
    if not (scene.crystal.precompression or scene.crystal.force):
        raise InvalidScene(
            f"{scene.name} is not pressed, and its contacts have no stiffness at rest; give "
            'crystal.precompression, as "1 um", or crystal.force.'
        )
    frequency = pipeline("crystal-modes").frequency
    still = int(np.sum(frequency < STILL * frequency[-1]))
    found = branches(scene)
    rows = [
        CrystalMode(number=i + 1, frequency_hz=float(f)) for i, f in enumerate(frequency[still:])
    ]
    dispersion = [
        Branch(axis=axis, wave_number=q.tolist(), frequency_hz=f.tolist())
        for axis, q, f in zip(*(found or ((), (), ())), strict=True)
    ]
    return CrystalModeTable(
        scene=scene.name,
        rows=rows,
        n_still=still,
        band_edges_hz=crystal_band_edges(scene),
        dispersion=dispersion,
    )


def dispersion_picture(table: CrystalModeTable) -> Picture:
    """Frequency over wave number along each axis, and the finite crystal's modes beside."""
    from beadwave.workflows.report import plots  # matplotlib takes a third of a second

    n = len(table.dispersion)
    figure, axes = plots.subplots(
        1, n + 1, (3.2 * n + 1.8, 3.8), sharey=True, width_ratios=[*[3] * n, 1]
    )
    for axis, branch in zip(axes, table.dispersion, strict=False):
        q, f = np.array(branch.wave_number), 1e-3 * np.array(branch.frequency_hz)
        for i, curve in enumerate(f.T):
            axis.plot(1e-3 * q, curve, color=plots.COLOURS[i % len(plots.COLOURS)], linewidth=1.4)
        axis.set_xlabel(f"wave number along {branch.axis} [1/mm]")
        axis.set_title("endless lattice", fontsize=9, loc="left")
        plots.frame(axis)
        axis.set_xlim(0.0, 1e-3 * q[-1])
    axes[0].set_ylabel("frequency [kHz]")
    last = axes[-1]
    frequency = 1e-3 * np.array([row.frequency_hz for row in table.rows])
    last.hlines(frequency, 0.0, 1.0, color=plots.COLOURS[0], linewidth=0.6)
    last.set_title("this crystal", fontsize=9, loc="left")
    last.set_xticks([])
    plots.frame(last)
    last.set_ylim(bottom=0.0)
    return Picture("dispersion", plots.png(figure))
