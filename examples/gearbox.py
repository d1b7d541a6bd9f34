"""Write gearbox.step: two walls and a bearing on a base, a shaft between, a cover on four holes.

python examples/gearbox.py gearbox.step
"""

import sys
from pathlib import Path

from geometry.cad import write_step
from geometry.shapes import Box, Cylinder, Hole, Plate

CORNERS = ((0.015, 0.015), (0.185, 0.015), (0.185, 0.085), (0.015, 0.085))
BASE = ((0, 0), (0.2, 0), (0.2, 0.1), (0, 0.1))
HOLES = tuple(Hole(0.0066, corner) for corner in CORNERS)
ENDS = ((0, 0), (0.03, 0), (0.03, 0.1), (0, 0.1))
BORES = (Hole(0.0066, (0.015, 0.015)), Hole(0.0066, (0.015, 0.085)))

SHAPES = {
    "base": Plate(BASE, 0.012),
    "wall-left": Plate(ENDS, 0.06, BORES, at=(0.0, 0.0, 0.012)),
    "wall-right": Plate(ENDS, 0.06, BORES, at=(0.17, 0.0, 0.012)),
    "bearing": Box((0.03, 0.1, 0.06), at=(0.1, 0.05, 0.042)),
    "shaft": Cylinder(0.008, 0.055, at=(0.0575, 0.05, 0.042), turn=(0.0, 90.0, 0.0)),
    "cover": Plate(BASE, 0.006, HOLES, at=(0.0, 0.0, 0.072)),
}

if __name__ == "__main__":
    write_step(SHAPES, Path(sys.argv[1]))
