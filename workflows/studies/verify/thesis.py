"""Published figures that a scene of the thesis' rig rebuilds.

The rig's drawings are lost and its dimensions inferred from these frequencies (table 5.2), so that
what is left is what no dimensions explain.
"""

from collections.abc import Iterator
from contextlib import nullcontext

import numpy as np

from coupling.verification.comparisons import Comparison, compared
from workflows.assembly.thesis_tables import table_52
from workflows.files.scene import scene
from workflows.studies.thesis.wall_modulus import FADED, PUBLISHED, wall_modulus

ALLOWED = 0.1  # of a frequency: the screws' stages, whose supports are not known
TABLE = "the thesis, table 5.2, by dimensions inferred from it"
YANG = "J. Yang et al., Phys. Rev. E 83 (2011) 046606"


def thesis() -> Iterator[Comparison]:
    """Table 5.2 of the thesis by its rig's inferred dimensions; where second waves fade out."""
    rig = scene("rig-rom", ())
    yield _second_waves(wall_modulus(rig, _silent).tables[0])
    for row in table_52(rig, _silent).rows:
        found = [(ours, theirs) for ours, theirs in zip(row.modes_hz, row.thesis_hz, strict=True)
                 if ours is not None]  # fmt: skip
        ours, theirs = max(found, key=lambda pair: abs(pair[0] / pair[1] - 1))
        name = f"{row.model}, worst of {len(found)} modes [Hz]"
        yield compared(name, ours, theirs, allowed=ALLOWED, source=TABLE)


def _silent(stage: str):
    return nullcontext()


def _second_waves(table) -> Comparison:
    """The lowest ratio of moduli at which a wall sends no second wave back."""
    ratio, second = (np.array(table.column(c)) for c in ("E*_w/E*_s", "second_over_striker"))
    gone = ratio[np.argmax(second <= FADED)]
    low, high = PUBLISHED
    return compared("second reflected wave fades out at E*_w/E*_s", gone, (low + high) / 2,
                    allowed=(high - low) / 2, of=1.0, source=YANG)  # fmt: skip
