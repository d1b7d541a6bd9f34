"""Draw gearbox.step beside this file: a shaft between two bearings on a base, and a cover on both
bearings that two bolts hold on a column.

python examples/gearbox.py && beadwave run examples/gearbox.toml
"""

import sys
from pathlib import Path

from beadwave.geometry.cad.occ import write_step
from beadwave.geometry.cad.shapes import Box, Cylinder, Hole, Slab

WIDE, DEEP = 0.2, 0.1  # m
BASE = ((0, 0), (WIDE, 0), (WIDE, DEEP), (0, DEEP))
COLUMN = ((0, 0), (0.03, 0), (0.03, DEEP), (0, DEEP))
BEARING = (0.03, DEEP, 0.03)
BOLTS = ((0.015, 0.015), (0.015, 0.085))

SHAPES = {
    "base": Slab(BASE, 0.012),
    "bearing-left": Box(BEARING, at=(0.035, 0.05, 0.027)),
    "bearing-right": Box(BEARING, at=(0.12, 0.05, 0.027)),
    "shaft": Cylinder(0.008, 0.055, at=(0.0775, 0.05, 0.027), turn=(0.0, 90.0, 0.0)),
    "column": Slab(COLUMN, 0.03, tuple(Hole(0.009, at) for at in BOLTS), at=(0.17, 0.0, 0.012)),
    "cover": Slab(
        BASE, 0.006, tuple(Hole(0.009, (0.17 + x, y)) for x, y in BOLTS), at=(0.0, 0.0, 0.042)
    ),
}

if __name__ == "__main__":
    default = Path(__file__).with_suffix(".step")
    write_step(SHAPES, Path(sys.argv[1]) if sys.argv[1:] else default)
