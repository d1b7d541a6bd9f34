"""The modes of a scene beside the hammer test: as a table, and their MAC matrix as a picture."""

import numpy as np
from pydantic import BaseModel

from workflows.files.run_folder import Picture
from workflows.pipeline.pipeline import Pipeline
from workflows.results import plots
from workflows.thesis import HAMMER_TEST_HZ

LEGIBLE = 0.05  # smallest MAC written into its cell


READING = """\
at contact: participation [kg^-1/2];  score: share of the mode's energy in the block's motion of
that hammer-test mode;  MAC: with that mode of stiff joints"""


class ModeRow(BaseModel):
    """One computed mode; `hammer_mode` where it is paired with one of the test.

    `score` is the share of its energy in that mode's motion of the block, `mac` that with the mode
    of stiff joints.
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
    participation, mac = pipeline("contact").w @ modes.phi, pipeline("mac")
    tested = {int(j): i for i, j in enumerate(modes.index) if j >= 0}
    rows = [
        _row(j, hz, participation[j], tested.get(j), modes.score, mac[j])
        for j, hz in enumerate(modes.omega / (2 * np.pi))
    ]
    return ModeTable(scene=pipeline.scene.name, rows=rows)


def mac_picture(pipeline: Pipeline) -> Picture:
    """The MAC matrix of the modes found with those of stiff joints."""
    hz = pipeline("modes").omega / (2 * np.pi)
    mac, stiff = pipeline("mac"), [f"mode {i}" for i in range(1, 5)]
    figure, (axis,) = plots.subplots(1, 1, (5, 1.2 + 0.26 * len(mac)))
    names = [f"{f:.0f} Hz" for f in hz], stiff
    plots.heat_map(axis, mac, names, "MAC", legible=LEGIBLE, limits=(0, 1))
    axis.set_xlabel("with stiff joints")
    return Picture("mac", plots.png(figure))


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
