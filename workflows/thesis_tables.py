"""Tables of the thesis rebuilt beside its numbers."""

from typing import NamedTuple

import numpy as np
from pydantic import BaseModel

from workflows.assembly_report import paired_hz
from workflows.assembly_table import BODIES
from workflows.scene import Scene
from workflows.stages import Watch, pipeline_of

SUPPORT = ("block", "sheets", "sheets_support", "support")
PLATE = (*SUPPORT, "plate")


class Row52(NamedTuple):
    """A model of table 5.2: its parts, how they are joined, the thesis' four modes."""

    model: str
    parts: tuple[str, ...]
    constraint: str
    thesis_hz: tuple[float, float, float, float]


TABLE_52 = (
    Row52("full-tie", SUPPORT[:2], "full-tie", (55.105, 630.0, 1134.0, 8171.6)),
    Row52("full-tie + support", SUPPORT, "full-tie", (53.7, 571.0, 1069.0, 8165.0)),
    Row52("full-tie + support + plate", PLATE, "full-tie", (53.6, 568.0, 1064.0, 8165.0)),
    Row52("screw-tie", SUPPORT[:2], "screw-tie", (35.9, 480.5, 905.0, 8140.0)),
    Row52("screw-tie + support", SUPPORT, "screw-tie", (35.0, 435.0, 854.0, 8136.0)),
    Row52("screw-tie + support + plate", PLATE, "screw-tie", (35.0, 397.0, 832.0, 8147.0)),
)


class TableRow(BaseModel):
    """Computed modes beside the thesis'; None where no mode has the shape."""

    model: str
    modes_hz: list[float | None]
    thesis_hz: list[float]
    difference_percent: list[float | None]


class Table(BaseModel):
    """Rows as `beadwave modes --table` prints them."""

    rows: list[TableRow]

    def text(self) -> str:
        """Aligned lines, computed over the thesis'."""
        return "\n".join(_lines(row) for row in self.rows)


def table_52(scene: Scene, watch: Watch) -> Table:
    """Full tie and screw tie through the three stages, with the scene's dimensions and mesh."""
    return Table(rows=[_row(scene, row, watch) for row in TABLE_52])


def _row(scene: Scene, row: Row52, watch: Watch) -> TableRow:
    # the drop by the plate needs one that is held at its corners
    fixing = "corners" if row.constraint == "screw-tie" and "plate" in row.parts else "flat"
    plain = dict.fromkeys(BODIES)  # the thesis' models are of one steel
    parts = {"parts": row.parts, "constraint": row.constraint, "fixing": fixing, **plain}
    varied = scene.model_copy(update={"assembly": scene.assembly.model_copy(update=parts)})
    found = paired_hz(pipeline_of(varied, watch)("modes"))
    hz = [found.get(str(i)) for i in (1, 2, 3, 4)]
    return TableRow(
        model=row.model,
        modes_hz=hz,
        thesis_hz=list(row.thesis_hz),
        difference_percent=[
            None if f is None else float(np.round(100 * (f / t - 1), 3))
            for f, t in zip(hz, row.thesis_hz, strict=True)
        ],
    )


def _lines(row: TableRow) -> str:
    computed = "".join(f"{'-' if f is None else f'{f:.2f}':>11}" for f in row.modes_hz)
    thesis = "".join(f"{f:11.2f}" for f in row.thesis_hz)
    return f"{row.model:28}{computed}  Hz\n{'thesis':>28}{thesis}  Hz"
