"""Second waves as published, and tables 5.2 and 5.3 of the thesis beside the rig, whose sizes the
thesis does not give: inferred ones meet its figures to a few per cent."""

from collections.abc import Iterator

import numpy as np

from beadwave.workflows.evidence.harness import Comparison, compared
from beadwave.workflows.evidence.thesis.wall_modulus import (
    PUBLISHED,
    WallModulusOptions,
    wall_modulus,
)
from beadwave.workflows.evidence.verify.published import EXACT
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.progress import quiet
from beadwave.workflows.structure.thesis_tables import TABLE_53, TableRow, table_52, table_53

FITTED, UNFITTED = 0.04, 0.2  # of a frequency that a tuning matches, and of one that it does not
YANG = "J. Yang et al., Phys. Rev. E 83 (2011) 046606"
HAMMER = "the thesis, table 5.1, hammer test"


def second_waves() -> Iterator[Comparison]:
    """The softness of a wall above which the chain is sent a second wave, and what stays."""
    table = wall_modulus(scene("rig-rom", ()), quiet).tables[0]
    ratio, second = (np.array(table.column(c)) for c in ("E*_w/E*_s", "second_over_striker"))
    low, high = PUBLISHED
    yield compared("second reflected wave fades out at E*_w/E*_s",
                   ratio[np.argmax(second <= WallModulusOptions().faded)], (low + high) / 2,
                   allowed=(high - low) / 2, of=1.0, source=YANG)  # fmt: skip
    yield compared("second reflected wave of walls stiffer than the spheres [V]",
                   second[ratio > 1], 0.03, allowed=0.01, of=1.0, source=EXACT)  # fmt: skip


def thesis_tables() -> Iterator[Comparison]:
    """Tables 5.2 and 5.3 of the thesis by `modes --table`, of four modes the worst: minutes."""
    rig = scene("rig-rom", ())
    for row in table_52(rig, quiet).rows:
        yield _worst(f"table 5.2, {row.model}", row, [*range(4)], FITTED, "the thesis, table 5.2")
    for match, row in zip(TABLE_53.values(), table_53(rig, quiet).rows, strict=True):
        matched = [i - 1 for i in match]
        source = HAMMER if "not in the thesis" in row.model else "the thesis, table 5.3"
        yield _worst(f"table 5.3, {row.model}", row, matched, FITTED, source)
        if unmatched := sorted({*range(4)} - {*matched}):
            name = f"table 5.3, {row.model}, not matched"
            yield _worst(name, row, unmatched, UNFITTED, source)


def _worst(name: str, row: TableRow, modes: list[int], allowed: float, source: str) -> Comparison:
    """Of these modes, counted from 0, the frequency that differs most."""
    ours, theirs = (np.array(hz, float)[modes] for hz in (row.modes_hz, row.thesis_hz))
    i = int(np.argmax(np.abs(ours / theirs - 1)))
    return compared(f"{name}, mode {modes[i] + 1} [Hz]", ours[i], theirs[i],
                    allowed=allowed, source=source)  # fmt: skip
