"""Published figures that a study of the thesis' rig rebuilds."""

from collections.abc import Iterator
from contextlib import nullcontext

import numpy as np

from workflows.evidence.thesis.wall_modulus import PUBLISHED, WallModulusOptions, wall_modulus
from workflows.evidence.verify.comparisons import Comparison, compared
from workflows.evidence.verify.published import EXACT
from workflows.files.scene import scene

YANG = "J. Yang et al., Phys. Rev. E 83 (2011) 046606"


def second_waves() -> Iterator[Comparison]:
    """The softness of a wall above which the chain is sent a second wave, and what stays."""
    table = wall_modulus(scene("rig-rom", ()), lambda stage: nullcontext()).tables[0]
    ratio, second = (np.array(table.column(c)) for c in ("E*_w/E*_s", "second_over_striker"))
    low, high = PUBLISHED
    yield compared("second reflected wave fades out at E*_w/E*_s",
                   ratio[np.argmax(second <= WallModulusOptions().faded)], (low + high) / 2,
                   allowed=(high - low) / 2, of=1.0, source=YANG)  # fmt: skip
    yield compared("second reflected wave of walls stiffer than the spheres [V]",
                   second[ratio > 1], 0.03, allowed=0.01, of=1.0, source=EXACT)  # fmt: skip
